"""Cut the power at every write and sync of short loops, and at random ones, go on, and judge what came of them.

python -m proving.crashes.loops [--loops 300] [--seed 1] [--every 3] [--lab voltmeter|attitude]

First the loop is crashed once at every `--every`-th write or sync (as by SIGKILL, which loses nothing, and as by a
power cut), then `--loops` of them are crashed at random moments, again and again. A loop that ends has to be closed,
with whole files, nothing left on, no run lost or doubled, and the verdicts that its run files give when they are
evaluated afresh. They need not be those of a loop that nobody disturbed, because a resumed run has other readings: so
is counted how often the true cause was confirmed. Traces of the same readings and the forecast of the first run are
computed once. In the laboratory of the voltmeter nothing stays on between two runs; in that for attitude the enclosure
does.
"""

from __future__ import annotations

import argparse
import contextlib
import itertools
import random
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any
from unittest.mock import patch

from proving.disk import Crash, Disk
from proving.loops import KINDS, Silent, files_of
from rig.by_kind import trace_table
from rig.drivers.clock import RealClock
from rig.engine.session import Outcome, Signals
from rig.examples import example
from rig.loop import Program, findings_of_runs, open_program, resume_loop, sessions, start_loop
from rig.loop.evaluation import Evaluation
from rig.run_file.live import LiveState
from rig.run_file.verify.verification import verify_file
from rig.runs.forecast import rehearse
from rig.runs.plans import Plan, load_plan
from rig.verbs.confirm import First, consider, first

LAB = "voltmeter-lab"
SHORTER = (("replications = 2", "replications = 1"), ("-1000, -500, ", "-1000, "))
TRUE = "range-step:input_V"
_MOST_CRASHES = 12


@dataclass(frozen=True)
class Lab:
    """The laboratory of the loops.

    Attributes:
        files: writes its files into a folder, once; returns procedure, bench and world.
        true: name of its hidden effect.
        hours: of a loop.
    """

    files: Callable[[Path], tuple[Path, Path, Path]]
    true: str
    hours: float

    def plan(self) -> Plan:
        """The plan of the first run."""
        with tempfile.TemporaryDirectory() as folder:
            procedure, bench, world = self.files(Path(folder))
            return load_plan(procedure, bench, dry=True, world=world)


def _voltmeter(folder: Path) -> tuple[Path, Path, Path]:
    lab = example(LAB)
    return shorter(folder), lab / "bench.toml", lab / "world.toml"


def _attitude(folder: Path) -> tuple[Path, Path, Path]:
    names = ("procedure", "bench", "world")
    procedure, bench, world = (folder / f"{name}.toml" for name in names)
    if not procedure.exists():
        files_of("attitude", KINDS["attitude"](1), folder)
    return procedure, bench, world


LABS = {
    "voltmeter": Lab(_voltmeter, TRUE, 3.0),
    "attitude": Lab(_attitude, "isolation-pad-deflection", 14.0),
}


class Evaluations:
    """What traces find, computed once for the same readings; the runs are the subject here."""

    def __init__(self, lab: Lab = LABS["voltmeter"]) -> None:
        self.lab = lab
        self._traced: dict[bytes, Any] = {}
        self._considered: dict[tuple[Any, ...], Any] = {}
        self._trace = trace_table
        self.forecast = cache(lambda: rehearse(lab.plan(), lambda _: None))

    def trace(self, table: Any, **options: Any) -> Any:
        """The trace of a table."""
        key = b"".join(values.tobytes() for _, values in sorted(table.columns.items()) if hasattr(values, "tobytes"))
        if key not in self._traced:
            self._traced[key] = self._trace(table, **options)
        return self._traced[key]

    def consider(self, asked: First, **how: Any) -> Any:
        """Possible further runs."""
        names = tuple(m.effect for q in asked.questions for m in q.members)
        key = (id(asked.traced), names, how.get("changes", True), asked.confirming.stands_degC)
        if key not in self._considered:
            self._considered[key] = consider(asked, **how)
        return self._considered[key]


@dataclass
class CrashedLoop:
    """A loop through however many crashes.

    Attributes:
        folder: of its files.
        evaluations: shared by loops.
        how: further arguments of `start_loop` and `resume_loop`.
        crashes: number of crashes so far.
        ends: expected outcome of a session that does not crash.
    """

    folder: Path
    evaluations: Evaluations
    how: dict[str, Any] = field(default_factory=dict)
    crashes: int = 0
    ends: Outcome = Outcome.COMPLETE

    @property
    def path(self) -> Path | None:
        """Its program file, if there is one by now."""
        return next(iter(self.folder.glob("*.loop.sqlite")), None)

    def go_on(self, disk: Disk | None = None) -> bool:
        """Begin the loop, or resume it; False if it crashed."""
        common: dict[str, Any] = {"signals": Signals(), "on_progress": lambda _: None, "told": Silent()}
        common |= {"considered": self.evaluations.consider, **self.how}
        with self.watched(disk):
            try:
                if self.path is None:
                    procedure, bench, world = self.evaluations.lab.files(self.folder)
                    ending = start_loop(
                        procedure, bench, self.folder, hours=self.evaluations.lab.hours, dry=True, world=world,
                        announce=lambda _path, _plan: None, **common,
                    )  # fmt: skip
                else:
                    ending = resume_loop(self.path, **common)
            except Crash:
                self.crashes += 1
                return False
        assert ending.outcome is self.ends, ending.message
        return True

    @contextlib.contextmanager
    def watched(self, disk: Disk | None = None) -> Iterator[None]:
        """A context with the shared evaluations, in which a crashed program leaves its files as they are."""
        remove = LiveState.remove

        def leaving(live: LiveState) -> None:
            if disk is None or not disk.crashed:  # a program that is gone takes nothing away
                remove(live)

        with (
            patch.object(first, "trace_table", self.evaluations.trace),
            patch.object(sessions, "rehearse", lambda _plan, _told: self.evaluations.forecast()),
            patch.object(LiveState, "remove", leaving),
        ):
            yield

    def judge(self) -> str:
        """Defects of the ended loop, "" if there are none."""
        path = self.path
        if path is None:
            return "there is no program file"
        wrong = [f"{one.name}: {found}" for one in sorted(self.folder.glob("*.sqlite")) for found in _findings(one)]
        program = open_program(path)
        wrong += [str(one) for one in findings_of_runs(program)]
        numbers = [run.planned.number for run in program.runs]
        if numbers != list(range(1, len(numbers) + 1)):
            wrong.append(f"runs {numbers}")
        runs = {one.name for one in self.folder.glob("*.sqlite")} - {path.name}
        if runs != {program.file_of(run).name for run in program.runs}:
            wrong.append(f"files of runs: {sorted(runs)}")
        wrong += [f"it is closed, and {on}" for on in program.on_between_runs]
        if program.closed is None or program.closed.fault:
            wrong.append("it is not closed" if program.closed is None else "a run ended by a fault")
        elif (said := dict(program.found[program.complete].verdicts)) != (fresh := self._afresh(program)):
            wrong.append(f"it says {said}, and its runs say {fresh}")
        return "; ".join(wrong)

    def _afresh(self, program: Program) -> dict[str, str]:
        """Verdicts by the run files alone."""
        with self.watched():
            evaluation = Evaluation(program)
            if (told := evaluation.told) is None:
                return {one.sensor: str(one.verdict) for one in evaluation.first.traced.outcomes}
            return {one.effect: one.verdict for one in told.answers}


def verdicts(program: Program) -> dict[str, str]:
    """Last verdicts of a loop."""
    return dict(program.found[program.complete].verdicts)


def _findings(path: Path) -> Sequence[str]:
    return [str(one) for one in verify_file(path).findings]


def shorter(folder: Path) -> Path:
    """A procedure of a few minutes."""
    path, text = folder / "procedure.toml", (example(LAB) / "procedure.toml").read_text()
    for old, new in SHORTER:
        text = text.replace(old, new)
    if not path.exists():
        path.write_text(text)
    return path


def undisturbed(evaluations: Evaluations) -> Program:
    """A loop without any crash. Raises AssertionError if it is wrong."""
    with tempfile.TemporaryDirectory() as folder:
        loop = CrashedLoop(Path(folder), evaluations)
        assert loop.go_on()
        assert not (wrong := loop.judge()), wrong
        assert loop.path is not None
        return open_program(loop.path)


def crash_at(nth: int, lost: Any, evaluations: Evaluations) -> tuple[bool, str]:
    """Crash a loop at its nth write or sync, and go on.

    Returns:
        whether there was an nth one, and what is wrong with the loop.
    """
    with tempfile.TemporaryDirectory() as folder, Disk(seed=nth, default=True) as disk:
        loop = CrashedLoop(Path(folder), evaluations)
        disk.crash_at(nth)
        crashed = not loop.go_on(disk)
        disk.power_cut(lost)
        if crashed:
            loop.go_on(disk)
        return crashed, loop.judge()


def crash_often(seed: int, evaluations: Evaluations) -> tuple[int, bool, str]:
    """Crash a loop at random writes or syncs; returns the number of crashes, whether the true cause was confirmed, and
    its defects.
    """
    rng = random.Random(seed)
    with tempfile.TemporaryDirectory() as folder, Disk(seed=seed, default=True) as disk:
        loop = CrashedLoop(Path(folder), evaluations)
        while True:
            if loop.crashes < _MOST_CRASHES:
                disk.crash_at(rng.randint(1, rng.choice((10, 40, 150))))
            else:
                disk.crash_at(10**9)
            if loop.go_on(disk):
                assert loop.path is not None
                right = verdicts(open_program(loop.path)).get(evaluations.lab.true) == "confirmed"
                return loop.crashes, right, loop.judge()
            disk.power_cut(rng.choice(("all", "some", "none")))


def main() -> int:
    """As the command line says; 1 if a loop is wrong."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--loops", type=int, default=300, help="loops that are crashed again and again")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--every", type=int, default=3, help="of the writes and syncs that are crashed once")
    parser.add_argument("--lab", choices=LABS, default="voltmeter")
    asked = parser.parse_args()
    stopwatch = RealClock().stopwatch
    lab = LABS[asked.lab]
    evaluations, wrong, began = Evaluations(lab), [], stopwatch()
    undisturbed(evaluations)
    once = 0
    for nth in itertools.count(1, asked.every):
        told = [crash_at(nth, lost, evaluations) for lost in ("none", "all")]
        wrong += [f"write or sync {nth}: {what}" for _, what in told if what]
        once += sum(crashed for crashed, _ in told)
        if not told[0][0]:
            break
    crashes = right = 0
    for seed in range(asked.seed, asked.seed + asked.loops):
        count, confirmed, what = crash_often(seed, evaluations)
        crashes, right = crashes + count, right + confirmed
        wrong += [f"seed {seed}: {what}"] if what else []
    print("\n".join(wrong))
    print(
        f"{once} loops crashed once, {asked.loops} crashed {crashes} times (seeds from {asked.seed}): "
        f"{len(wrong)} lost, doubled or wrong, {right} with {lab.true} confirmed; {stopwatch() - began:.0f} s"
    )
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
