"""A run of a million points with seven sensors: memory, journal time a point, resuming, and what a commit costs.

    .venv/bin/python -m benchmarks.load                  # everything; half an hour
    .venv/bin/python -m benchmarks.load run 1000000      # one run, in a process of its own
    .venv/bin/python -m benchmarks.load late 1000000     # the end of one, without waiting for all of it
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
import hashlib
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
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import apsw

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))

import ideal_bench

from benchmarks.scratch import RUNS
from procedures import Factor, Point, RunList
from rig.bench import Bench
from rig.controller import Plan, Result, Site, plan_of, resume_run, start_run
from rig.engine.chain import Record, encode
from rig.engine.journal import Journal
from rig.engine.run_creation import Genesis, create
from rig.engine.run_writer import RunWriter
from rig.engine.session import Outcome, Progress, Signals
from sims.world import World

ROOT = Path(__file__).parent.parent
SENSORS = ("s1", "s2", "s3", "s4", "s5", "s6", "s7")
CELLS = 1000
WINDOW = 10_000
PARTS = ("all", "run", "late", "resume", "killed", "resumed", "commit")

BENCH = """
name = "load"
[instruments.head]
driver = "newport-esp301"
address = "/dev/rig/head"
[instruments.scanner]
driver = "keysight-34970a"
address = "/dev/rig/scanner"
[instruments.scanner.channels]
108 = "thermistor-10k"
CHANNELS
[temperatures.sensor_temperature_degC]
reader = "scanner"
channel = "108"
[limits]
pitch_deg = [-95, 95]
roll_deg = [-185, 185]
"""
SENSOR = """
[sensors.NAME]
axis = "x"
reader = "scanner"
channel = "CHANNEL"
"""
PROCEDURE = """
kind = "pitch-roll"
name = "load"
seed = 1
replications = REPLICATIONS
[design]
type = "D1"
pitch_max_deg = 90
pitch_count = 40
roll_count = 25
[settle]
dwell_s = 1.0
[measure]
readings = 5
"""


_READ = {"mean": 0.7857167547142776, "sd": 1.951915885742837e-06, "readings": [0.7857155202142776] * 5}
_SETTLED = {"outcome": "settled", "seconds": 1.0, "samples": [[0.5 * i, -25.384615385] for i in range(3)]}
OBSERVATION = {
    "approach": {"pitch": [1, -30.0], "roll": [1, -180.0]},
    "readback": {"pitch_deg": -25.384615385, "roll_deg": -165.0},
    "settling": {"pitch": _SETTLED, "roll": _SETTLED},
    "measured_s": [123456.5, 123459.0],
    "environment": {},
    "outputs": {f"{name}_V": _READ for name in SENSORS},
    "temperatures": {"sensor_temperature_degC": _READ},
    "flags": [],
}
BODY = encode(OBSERVATION)
"""As large as an observation of seven sensors."""


def planned(points: int) -> Plan:
    """The plan of a run of so many points, a multiple of 1000, as from files."""
    channels = {name: str(101 + i) for i, name in enumerate(SENSORS)}
    bench = BENCH.replace("CHANNELS", "\n".join(f'{channel} = "volts"' for channel in channels.values()))
    bench += "".join(SENSOR.replace("NAME", n).replace("CHANNEL", c) for n, c in channels.items())
    procedure = PROCEDURE.replace("REPLICATIONS", str(points // CELLS))
    return plan_of({"bench.toml": bench, "procedure.toml": procedure}, dry=True)


class Head(ideal_bench.IdealHead):
    """The ideal head, which does not remember where it was sent. Notes when it was first asked to move."""

    first_move_s: float | None = None

    def __init__(self, world: World) -> None:
        super().__init__(world)
        self.sent = deque(maxlen=1)  # type: ignore[assignment]

    def move(self, targets_deg: Mapping[str, float]) -> None:
        if Head.first_move_s is None:
            Head.first_move_s = time.process_time()
        super().move(targets_deg)


class Scanner(ideal_bench.IdealReader):
    """Seven sensors and a thermistor; every reading with all its digits, as an instrument gives them."""

    def channels(self) -> Sequence[str]:
        return tuple(str(101 + i) for i in range(len(SENSORS) + 1))

    def fetch(self) -> Mapping[str, Sequence[float]]:
        volts = self.world.now() / 7.0 % 1.0
        readings = [volts + 1.2345e-6 * i for i in range(self._count)]
        found: dict[str, Sequence[float]] = {str(101 + i): [r / (i + 1) for r in readings] for i in range(len(SENSORS))}
        return found | {str(101 + len(SENSORS)): [23.0123 + r for r in readings]}


@contextlib.contextmanager
def ideal(plan: Plan, *, start: float = 0.0) -> Iterator[tuple[Bench, World, str]]:
    """The bench of a plan with ideal instruments."""
    world = World(start)
    head = Head(world)
    instruments = {"head": head, "scanner": Scanner(world, head)}
    yield Bench(plan.bench, instruments, world, ideal_bench.NoWires()), world, "virtual"  # type: ignore[arg-type]


class _UnsyncedFile(apsw.VFSFile):
    def __init__(self, name: Any, flags: list[int]) -> None:
        super().__init__("", name, flags)

    def xSync(self, flags: int) -> None:  # noqa: N802 - apsw's name
        """Leave it to the system."""


class UnsyncedVFS(apsw.VFS):
    """A disk that says it is done at once."""

    def __init__(self) -> None:
        super().__init__("unsynced", "")

    def xOpen(self, name: Any, flags: list[int]) -> apsw.VFSFile:  # noqa: N802 - apsw's name
        return _UnsyncedFile(name, flags)


class JournalTimes:
    """Time spent in the journal point by point: records written, state kept up to date, news spread.

    Args:
        points: of the run.
        window: how many of the first and of the last of them are kept.

    """

    def __init__(self, points: int, window: int) -> None:
        self._total, self._window, self._points = points, window, 0
        self._first: list[tuple[float, float, float]] = []
        self._last: list[tuple[float, float, float]] = []
        self._depth = 0
        self._wall_s = self._processor_s = 0.0
        for name in ("write", "tell", "take_up", "point_observed"):
            setattr(Journal, name, self._timed(getattr(Journal, name)))

    def _timed(self, method: Any) -> Any:
        def timed(journal: Journal, *args: Any, **named: Any) -> Any:
            self._depth += 1
            wall, processor = time.perf_counter(), time.process_time()
            try:
                return method(journal, *args, **named)
            finally:
                self._depth -= 1
                if not self._depth:
                    self._wall_s += time.perf_counter() - wall
                    self._processor_s += time.process_time() - processor
                if method.__name__ == "point_observed":
                    self._keep((self._wall_s, self._processor_s))

        return timed

    def _keep(self, journal: tuple[float, float]) -> None:
        self._points += 1
        if self._points <= self._window or self._points > self._total - self._window:
            began = time.process_time()
            hashlib.sha256(encode(OBSERVATION).encode()).digest()
            kept = self._first if self._points <= self._window else self._last
            kept.append((*journal, time.process_time() - began))
        self._wall_s = self._processor_s = 0.0

    def summary(self) -> dict[str, Any]:
        """Medians of the first and last points, microseconds, and last over first.

        The last figure is the processor time's ratio with the machine's own speed taken out of it, which on a busy
        machine changes by half within a run: every point of both windows has a fixed piece of work timed beside it.
        """
        found: dict[str, Any] = {"window": self._window}
        for at, name in enumerate(("journal_wall", "journal_processor", "fixed_work")):
            first, last = (statistics.median(p[at] * 1e6 for p in points) for points in (self._first, self._last))
            found[f"{name}_us"] = [round(first, 1), round(last, 1), round(last / first, 3)]
        ratio = found["journal_processor_us"][2] / found["fixed_work_us"][2]
        return {**found, "journal_ratio": round(ratio, 3)}


def peak_mb() -> float:
    """Peak resident memory of this process so far, megabytes; `getrusage` would count its parent's too."""
    status = Path("/proc/self/status").read_text(encoding="ascii")
    return int(status.partition("VmHWM:")[2].split()[0]) / 1024.0


def one_run(points: int, folder: Path, vfs: str) -> dict[str, Any]:
    """A whole run, in this process."""
    imports = peak_mb()
    times = JournalTimes(points, min(WINDOW, points // 2))
    began = time.process_time()
    plan = planned(points)
    expanded = time.process_time()
    result = _run(plan, folder, vfs)
    assert result.outcome is Outcome.COMPLETE, result.message
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
        **times.summary(),
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


def one_late(points: int, folder: Path, options: Sequence[str]) -> dict[str, Any]:
    """The journal in the last points of a long run, recorded beforehand up to there, beside that of a short run."""
    last = 2 * min(WINDOW, points // 4)
    plan = planned(points)
    path = folder / "late.sqlite"
    about = {"dry": True, "procedure": "load", "bench": "load", "software": {}}
    create(path, Genesis("late", plan.documents, plan.run_list, True, about), elapsed_s=0.0, utc_s=0.0)
    with RunWriter.open(path) as run:
        for i in range(points - last):
            run.append(
                Record(1, "observation", float(i), float(i), i, None, 1, "accepted", BODY), commit=i % 1000 == 999
            )
        run.commit()
    late = _worker("resumed", str(path), "--timed", str(last), *options)
    early = _worker("run", str(last), *options)
    ratio = [one["journal_processor_us"][1] / one["fixed_work_us"][1] for one in (late, early)]
    return {"points": points, "late": late, "early": early, "journal_ratio": round(ratio[0] / ratio[1], 3)}


def killed(points: int, folder: Path, vfs: str) -> None:
    """Run until ten points are left, and die."""

    def look(news: Progress) -> None:
        if news.done >= points - 10:
            os.kill(os.getpid(), signal.SIGKILL)

    _run(planned(points), folder, vfs, look)


def resumed(path: Path, vfs: str, timed: int) -> dict[str, Any]:
    """Resume in this process, imports done; the journal of so many points is timed."""
    before = peak_mb()
    times = JournalTimes(timed, timed // 2) if timed else None
    began, Head.first_move_s = time.process_time(), None
    result = resume_run(path, signals=Signals(), on_progress=lambda _: None, site=Site(ideal, vfs))
    assert result.outcome is Outcome.COMPLETE, result.message
    assert Head.first_move_s is not None
    return {
        "ready_to_command_s": round(Head.first_move_s - began, 2),
        "imports_s": round(began, 2),
        "imports_mb": round(before, 1),
        "peak_mb": round(peak_mb(), 1),
        **(times.summary() if times else {}),
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
        "resume": _worker("resume", "100000", *options),
        "commit": _worker("commit"),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", nargs="?", default="all", choices=PARTS)
    parser.add_argument("of", nargs="?", default="100000", help="points; for `resumed`, the run file")
    parser.add_argument("--timed", type=int, default=0, help="with `resumed`: points to be observed, and timed")
    parser.add_argument("--no-sync", action="store_true", help="do not wait for the disk")
    parser.add_argument("--folder", type=Path, default=RUNS, help="where the run files go meanwhile")
    given = parser.parse_args()
    unsynced = UnsyncedVFS() if given.no_sync else None
    vfs, options = ("unsynced", ["--no-sync"]) if unsynced else ("", [])
    with tempfile.TemporaryDirectory(dir=given.folder) as name:
        folder = Path(name)
        match given.what:
            case "all":
                found = everything(options)
            case "run":
                found = one_run(int(given.of), folder, vfs)
            case "resume":
                found = one_resume(int(given.of), folder, options)
            case "late":
                found = one_late(int(given.of), folder, options)
            case "killed":
                killed(int(given.of), given.folder, vfs)
                return
            case "resumed":
                found = resumed(Path(given.of), vfs, given.timed)
            case _:
                found = commits(folder)
    print(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
