"""A run of a million points with seven sensors: memory, journal time a point, resuming, and what a commit costs.

    .venv/bin/python -m benchmarks.load                  # everything; half an hour
    .venv/bin/python -m benchmarks.load run 1000000      # one run, in a process of its own
    .venv/bin/python -m benchmarks.load late 1000000     # the journal at the end of one, beside a short one
    .venv/bin/python -m benchmarks.load resume 100000
    .venv/bin/python -m benchmarks.load commit

The controller is the whole one: files parsed, run list expanded, checked, hashed and stored, every state of the
sequencer, one commit a point. Only the instruments are ideal ones under virtual time, so that nothing but the
controller takes time. `--no-sync` leaves the disk's own waiting away (the run file then is not safe from a power
cut): processor time and memory are the same, and a busy disk does not take hours.
"""

from __future__ import annotations

import argparse
import contextlib
import itertools
import json
import os
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from array import array
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from benchmarks.load_bench import BODY, Head, ideal, planned
from benchmarks.load_journal import JournalTimes, Turns, compared
from benchmarks.scratch import RUNS
from rig.engine.session import Outcome, Progress, Signals
from rig.procedures.plan.run_list import Factor, Point, RunList
from rig.run_file.chain import Record
from rig.run_file.write.creation import Genesis, create
from rig.run_file.write.unsynced import unsynced
from rig.run_file.write.writer import RunWriter
from rig.runs.controller import Result, Site, resume_run, start_run
from rig.runs.plans import Plan

ROOT = Path(__file__).parent.parent
WINDOW = 10_000
PARTS = ("all", "run", "late", "resume", "killed", "resumed", "commit")


def peak_mb() -> float:
    """Peak resident memory of this process so far, megabytes; `getrusage` would count its parent's too."""
    status = Path("/proc/self/status").read_text(encoding="ascii")
    return int(status.partition("VmHWM:")[2].split()[0]) / 1024.0


def one_run(points: int, folder: Path, vfs: str) -> dict[str, Any]:
    """A whole run, in this process."""
    imports = peak_mb()
    began = time.process_time()
    plan = planned(points)
    expanded = time.process_time()
    result = _complete(_run(plan, folder, vfs))
    assert len(result.state.accepted) == points
    size = result.path.stat().st_size
    result.path.unlink()
    return {
        "points": points,
        "peak_mb": round(peak_mb(), 1),
        "imports_mb": round(imports, 1),
        "run_list": plan.run_list.sha256()[:16],
        "file_bytes_a_point": round(size / points),
        "expand_s": round(expanded - began, 1),
        "processor_us_a_point": round((time.process_time() - expanded) / points * 1e6),
    }


def _run(plan: Plan, folder: Path, vfs: str, look: Callable[[Progress], None] = lambda _: None) -> Result:
    site = Site(ideal, vfs)
    return start_run(plan, folder, signals=Signals(), announce=lambda _: None, on_progress=look, site=site)


def one_resume(points: int, folder: Path, options: Sequence[str]) -> dict[str, Any]:
    """Resume a run that was killed with ten points left, its log still there, in a process of its own."""
    command = [sys.executable, "-m", "benchmarks.load", "killed", str(points), "--folder", str(folder), *options]
    assert subprocess.run(command, check=False, cwd=ROOT).returncode == -signal.SIGKILL
    (path,) = folder.rglob("*.sqlite")
    log = path.with_name(path.name + "-wal").stat().st_size
    return {"points": points, "log_bytes": log, **_worker("resumed", str(path), *options)}


def one_late(points: int, folder: Path, vfs: str) -> dict[str, Any]:
    """The last points of a long run, recorded beforehand up to there, beside those of a short run: journal and all."""
    last = min(WINDOW, points // 4)
    plan, short = planned(points), planned(last)
    path = folder / "late.sqlite"
    about = {"dry": True, "procedure": "load", "bench": "load", "software": {}}
    create(path, Genesis("late", plan.documents, plan.run_list, True, about), elapsed_s=0.0, utc_s=0.0)
    with RunWriter.open(path) as run:
        for i in range(points - last):
            run.append(
                Record(1, "observation", float(i), float(i), i, None, 1, "accepted", BODY), commit=i % 1000 == 999
            )
        run.commit()
    turns = Turns()
    times = JournalTimes(turns.point_done)
    turns.carry_out(
        lambda: _complete(resume_run(path, signals=Signals(), on_progress=lambda _: None, site=Site(ideal, vfs))),
        lambda: _complete(_run(short, folder / "early", vfs)),
    )
    journal, whole = compared(*times.of.values(), "journal"), compared(*times.points.values(), "point")
    return {"points": points, "window": last, "peak_mb": round(peak_mb(), 1), **journal, **whole}


def _complete(result: Result) -> Result:
    assert result.outcome is Outcome.COMPLETE, result.message
    return result


def killed(points: int, folder: Path, vfs: str) -> None:
    """Run until ten points are left, and die."""

    def look(news: Progress) -> None:
        if news.done >= points - 10:
            os.kill(os.getpid(), signal.SIGKILL)

    _run(planned(points), folder, vfs, look)


def resumed(path: Path, vfs: str) -> dict[str, Any]:
    """Resume in this process, imports done."""
    before = peak_mb()
    began, Head.first_move_s = time.process_time(), None
    _complete(resume_run(path, signals=Signals(), on_progress=lambda _: None, site=Site(ideal, vfs)))
    assert Head.first_move_s is not None
    return {
        "ready_to_command_s": round(Head.first_move_s - began, 2),
        "imports_s": round(began, 2),
        "imports_mb": round(before, 1),
        "peak_mb": round(peak_mb(), 1),
    }


def commits(folder: Path, rounds: int = 30, each: int = 100) -> dict[str, Any]:
    """A commit of one observation beside a bare append and fdatasync of its bytes, in turn."""
    path = folder / "commits.sqlite"
    create(path, Genesis("commits", {}, _few(rounds * each), True, {}), elapsed_s=0.0, utc_s=0.0)
    bare = os.open(folder / "bare", os.O_CREAT | os.O_RDWR)
    ours, theirs = array("d"), array("d")
    count = itertools.count()
    with RunWriter.open(path) as run:
        for _ in range(rounds):
            for i in itertools.islice(count, each):
                record = Record(1, "observation", float(i), float(i), i, None, 1, "accepted", BODY)
                began = time.perf_counter()
                run.append(record)
                ours.append(time.perf_counter() - began)
            for _ in range(each):
                began = time.perf_counter()
                os.write(bare, BODY.encode())
                os.fdatasync(bare)
                theirs.append(time.perf_counter() - began)
    os.close(bare)
    path.unlink()
    found = {"body_bytes": len(BODY)}
    for name, times in (("commit", ours), ("bare_fdatasync", theirs)):
        low, *_, middle = statistics.quantiles(times, n=10)[:5]
        found[f"{name}_us"] = [round(low * 1e6), round(middle * 1e6)]  # type: ignore[assignment]
    pairs = zip(found["commit_us"], found["bare_fdatasync_us"], strict=True)  # type: ignore[call-overload]
    return {**found, "ratio": [round(a / b, 2) for a, b in pairs]}


def _few(points: int) -> RunList:
    factor = Factor("pitch_deg", "pitch")
    return RunList((factor,), (Point(i, 1, None, (float(i % 7),), (1,)) for i in range(points)), 0)


def _worker(*arguments: str) -> dict[str, Any]:
    command = [sys.executable, "-m", "benchmarks.load", *arguments]
    done = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True, cwd=ROOT)
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def everything(options: list[str]) -> dict[str, Any]:
    """All of it, every run in a process of its own."""
    small, large = (_worker("run", n, *options) for n in ("100000", "1000000"))
    return {
        "run": [small, large],
        "growth_mb": round(large["peak_mb"] - small["peak_mb"], 1),
        "late": _worker("late", "1000000", *options),
        "resume": _worker("resume", "100000", *options),
        "commit": _worker("commit"),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", nargs="?", default="all", choices=PARTS)
    parser.add_argument("of", nargs="?", default="100000", help="points; for `resumed`, the run file")
    parser.add_argument("--no-sync", action="store_true", help="do not wait for the disk")
    parser.add_argument("--folder", type=Path, default=RUNS, help="where the run files go meanwhile")
    given = parser.parse_args()
    options = ["--no-sync"] if given.no_sync else []
    waiting = unsynced() if given.no_sync else contextlib.nullcontext("")
    with tempfile.TemporaryDirectory(dir=given.folder) as name, waiting as vfs:
        folder = Path(name)
        match given.what:
            case "all":
                found = everything(options)
            case "run":
                found = one_run(int(given.of), folder, vfs)
            case "resume":
                found = one_resume(int(given.of), folder, options)
            case "late":
                found = one_late(int(given.of), folder, vfs)
            case "killed":
                killed(int(given.of), given.folder, vfs)
                return
            case "resumed":
                found = resumed(Path(given.of), vfs)
            case _:
                found = commits(folder)
    print(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
