"""Crashes, damages, power cuts and real kills in full: nothing that was acknowledged may be lost, doubled or wrong.

A seed of `kills` and `power-cuts` is a run; of `points` and `folded` the number of a write or sync. Folded: in runs
whose log is folded into the file every few pages, as that of a long run is in the end. `log` and `file` take one seed.
"""

from __future__ import annotations

import tempfile
from collections import Counter
from collections.abc import Callable, Mapping
from contextlib import nullcontext
from functools import partial
from pathlib import Path

from proving.crashes.damages import FLIPS, Interrupted, file_damages, log_damages, small_finished
from proving.crashes.kills import one_run
from proving.crashes.runs import PROCEDURES, Lost, crash_once, power_cuts
from proving.disk import folding
from proving.frame import Figures, Part, Results, Study
from proving.ledger import Result

RUNS = Path(__file__).parents[2] / "runs"
"""Where killed runs lie: not in a memory file system, but on the disk that holds the project."""
LOST: tuple[Lost, ...] = ("none", "all", "some")
_FOLD_PAGES = 4
_ENDS = 10_000
"""Writes and syncs that no short run has."""


def _study(cases: Mapping[str, Callable[[int], Result]], enough: Callable[[Results], bool] | None = None) -> Study:
    return Study(cases, _told, enough=enough, fails=lambda rows: any(row["wrong"] for row in rows.values()))


def _told(results: Results) -> Figures:
    """Sums of what was counted, and what is wrong."""
    counts: Counter[str] = Counter()
    for one in results:
        counts.update(one["counts"])
    wrong = [what for one in results for what in one["wrong"]]
    return {**counts, "wrong": len(wrong), **({"what": wrong} if wrong else {})}


def kills(most: int = 12, longest_s: float = 1.4) -> Study:
    """Real SIGKILLs: each run is killed up to `most` times, at a random moment within `longest_s` of its start."""
    return _study({lab: partial(_killed, lab=lab, most=most, longest_s=longest_s) for lab in PROCEDURES})


def _killed(seed: int, lab: str, most: int, longest_s: float) -> Result:
    RUNS.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory(dir=RUNS) as folder:
        tally = one_run(Path(folder), seed, kills=most, longest_s=longest_s, lab=lab)
    bad = {name: getattr(tally, name) for name in ("lost", "duplicated", "wrong_side")}
    counts = {"kills": tally.kills, "runs": tally.runs, "points": tally.points, **bad}
    return {"counts": counts, "wrong": [f"seed {seed}: {bad}"] if any(bad.values()) else []}


def cuts(most: int = 10) -> Study:
    """Power cuts at random moments of short runs, up to `most` in each, which is resumed every time."""
    return _study({lab: partial(_cut, lab=lab, most=most) for lab in PROCEDURES})


def _cut(seed: int, lab: str, most: int) -> Result:
    with tempfile.TemporaryDirectory() as folder:
        done, run, verdict = power_cuts(lab, Path(folder), seed, cuts=most)
    counts = {"power cuts": done, "runs": 1, "observations acknowledged": len(run.acknowledged)}
    return {"counts": counts, "wrong": [f"seed {seed}: {verdict}"] if verdict else []}


def points(every: int = 1) -> Study:
    """A crash at every write and sync, file creation included, unsynced data kept, lost, or lost in part."""
    return _points(every, folded=False)


def folded(every: int = 1) -> Study:
    """The same in runs whose log is folded into the file every few pages."""
    return _points(every, folded=True)


def _points(every: int, *, folded: bool) -> Study:
    which = [(lab, lost) for lab in PROCEDURES for lost in LOST]
    cases = {f"{lab}, {lost} lost": partial(_crashed, lab=lab, lost=lost, every=every, folded=folded)
             for lab, lost in which}  # fmt: skip
    return _study(cases, lambda known: not known[-1]["counts"]["crashed"])


def _crashed(number: int, lab: str, lost: Lost, every: int, *, folded: bool) -> Result:
    nth = 1 + number * every
    with tempfile.TemporaryDirectory() as folder, folding(_FOLD_PAGES) if folded else nullcontext():
        crashed, run, verdict = crash_once(lab, Path(folder), nth, lost, seed=nth)
    counts = {"crashed": int(crashed), "resumed with a warning": int(bool(run.warnings))}
    return {"counts": counts, "wrong": [f"crash at {nth}: {verdict}"] if verdict else []}


def log(every: int = 1) -> Study:
    """A bit flipped, and a cut, at every byte of the log's last two commits, and at every edge of a frame."""
    return _study({lab: partial(_of_log, lab=lab, every=every) for lab in PROCEDURES})


def _of_log(_seed: int, lab: str, every: int) -> Result:
    with tempfile.TemporaryDirectory() as folder:
        counts, wrong = log_damages(Interrupted.make(lab, Path(folder)), every)
    return {"counts": counts, "wrong": wrong}


def file(every: int = 1) -> Study:
    """A bit flipped in every 512 bytes of a finished file and in each byte of its header, and cuts."""
    return _study({lab: partial(_of_file, lab=lab, every=every) for lab in PROCEDURES})


def _of_file(_seed: int, lab: str, every: int) -> Result:
    with tempfile.TemporaryDirectory() as folder:
        counts, wrong = file_damages(small_finished(lab, Path(folder)), FLIPS, every)
    return {"counts": counts, "wrong": wrong}


PARTS = {
    "kills": Part(kills, 17, 1),
    "power-cuts": Part(cuts, 50, 1),
    "points": Part(points, _ENDS),
    "folded": Part(folded, _ENDS),
    "log": Part(log, 1),
    "file": Part(file, 1),
}
