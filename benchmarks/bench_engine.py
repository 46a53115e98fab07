"""Our own time per point, with a durable commit, beside bluesky's RunEngine, which stores nothing.

Both run 2,886 points on instruments that answer at once, in the same process, in turn. Also: what the file system
asks for one fdatasync of a record's size, what a commit takes beside it (`benchmarks.load`, which has the long runs
too), and how many syncs a commit really makes, counted by a recording VFS.

    .venv/bin/python benchmarks/bench_engine.py
"""

from __future__ import annotations

import contextlib
import importlib.util
import itertools
import os
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest.mock import patch

import apsw

sys.path.insert(0, str(Path(__file__).parent.parent / "tests" / "support"))
sys.path.insert(0, str(Path(__file__).parent.parent))

import ideal_bench

from benchmarks.load import commits
from benchmarks.scratch import RUNS
from rig.engine.at_point import AtPoint
from rig.engine.early_warning import EarlyWarnings
from rig.engine.guard import Guard
from rig.engine.journal import Journal
from rig.engine.liveness import Liveness
from rig.procedures.attitude.settings import PitchRollProcedure
from rig.run_file.chain import Record, encode
from rig.run_file.write.writer import RunWriter

MEMORY = Path("/dev/shm") if Path("/dev/shm").is_dir() else None
POINTS = 2886
ROUNDS = 3
TURN = 20
"""Points of a run after which it is watched, or no longer."""


def procedure() -> PitchRollProcedure:
    return PitchRollProcedure.model_validate(
        {
            "kind": "pitch-roll",
            "name": "night",
            "design": {"type": "D1", "pitch_max_deg": 90, "pitch_count": 37, "roll_count": 13},
            "settle": {"dwell_s": 1.0},
        }
    )


def noisy(_, __, reader: ideal_bench.IdealReader) -> None:
    """Readings that never change are taken for frozen ones."""
    reader.noise_V = 1e-6


def ours(folder: Path) -> tuple[float, float]:
    """Wall and processor seconds a point, ideal instruments' arithmetic included."""
    path = ideal_bench.new_run(folder, procedure())
    began, before = time.perf_counter(), time.process_time()
    _, state, *_ = ideal_bench.run_session(path, procedure=procedure(), spoil=noisy)
    seconds, processor = time.perf_counter() - began, time.process_time() - before
    assert len(state.accepted) == POINTS
    path.unlink()
    return seconds / POINTS, processor / POINTS


@dataclass
class Looks:
    """Whether a run has early warnings, limits, interlocks, liveness, live state and progress now."""

    on: bool = True

    @contextlib.contextmanager
    def can_be_off(self) -> Iterator[None]:
        """For as long as it lasts, runs have them only while they are on."""
        with contextlib.ExitStack() as stack:
            for owner, name, nothing in (
                (EarlyWarnings, "add", []),
                (Liveness, "hanging", []),
                (Guard, "check_axes", None),
                (Guard, "check_temperatures", None),
                (Journal, "tell", None),
            ):
                stack.enter_context(patch.object(owner, name, self._if_on(getattr(owner, name), nothing)))
            yield

    def _if_on(self, look: Callable[..., Any], nothing: object) -> Callable[..., Any]:
        return lambda *given, **named: look(*given, **named) if self.on else nothing


def point_s(folder: Path, looks: Looks) -> dict[bool, float]:
    """Wall seconds between two records, the first quartile: other work lengthens the other points.

    Looks are on and off in turns of some points of one run, since a shared machine changes its speed within seconds.
    """
    moments: list[float] = []
    recording = AtPoint.recording

    def timed(self: AtPoint) -> str:
        looks.on = len(moments) // TURN % 2 == 0
        moments.append(time.perf_counter())
        return recording(self)

    with patch.object(AtPoint, "recording", timed):
        ours(folder)
    looks.on = True
    took: dict[bool, list[float]] = {True: [], False: []}
    for i, (before, after) in enumerate(itertools.pairwise(moments)):
        took[i // TURN % 2 == 0].append(after - before)
    return {on: statistics.quantiles(each, n=4)[0] for on, each in took.items()}


def bluesky() -> tuple[float, float]:
    """Wall and processor seconds a point of a two-motor, one-detector scan that nobody listens to."""
    from bluesky import RunEngine
    from bluesky.plan_stubs import close_run, mv, open_run, trigger_and_read
    from ophyd.sim import SynAxis, det

    engine = RunEngine({})
    pitch, roll = SynAxis(name="pitch"), SynAxis(name="roll")

    def scan():
        yield from open_run()
        for i in range(POINTS):
            yield from mv(pitch, i % 37, roll, i % 13)
            yield from trigger_and_read([det, pitch, roll])
        yield from close_run()

    began, before = time.perf_counter(), time.process_time()
    engine(scan())
    return (time.perf_counter() - began) / POINTS, (time.process_time() - before) / POINTS


def bare_sync(folder: Path) -> float:
    """Seconds of syncing 2,000 appended bytes, the first quartile, as of points."""
    file = os.open(folder / "bare", os.O_CREAT | os.O_RDWR)
    times = []
    for _ in range(500):
        os.write(file, b"x" * 2000)
        began = time.perf_counter()
        os.fdatasync(file)
        times.append(time.perf_counter() - began)
    os.close(file)
    return statistics.quantiles(times, n=4)[0]


class CountingFile(apsw.VFSFile):
    """Counts syncs of one file."""

    def __init__(self, name, flags, counts):
        super().__init__("", name, flags)
        text = name if isinstance(name, str) else name.filename()
        self.counts, self.key = counts, "log" if text.endswith("-wal") else "main"

    def xSync(self, flags):  # noqa: N802 - apsw's name
        self.counts[self.key] = self.counts.get(self.key, 0) + 1
        super().xSync(flags)


class CountingVFS(apsw.VFS):
    """Counts syncs of all files."""

    def __init__(self):
        self.counts: dict[str, int] = {}
        super().__init__("counting", "")

    def xOpen(self, name, flags):  # noqa: N802 - apsw's name
        return CountingFile(name, flags, self.counts)


def syncs(folder: Path) -> dict[str, float]:
    """Syncs a commit, of the log and of the main file (checkpoints)."""
    path = ideal_bench.new_run(folder, procedure())
    vfs = CountingVFS()
    with RunWriter.open(path, vfs="counting") as run:
        vfs.counts.clear()
        for i in range(1000):
            body = encode({"outputs": {"x_V": {"readings": [0.1 * i] * 120}}})
            run.append(Record(1, "observation", i, i, i, None, 1, "accepted", body))
    counts = dict(vfs.counts)
    path.unlink()
    return {key: value / 1000 for key, value in counts.items()}


def middle(times: list[tuple[float, float]]) -> tuple[float, float]:
    """Medians of wall and processor time."""
    wall, processor = (statistics.median(column) for column in zip(*times, strict=True))
    return wall, processor


def main() -> None:
    peer = importlib.util.find_spec("bluesky") is not None
    if not peer:
        print("bluesky is not installed: pip install -e '.[bench]'")
    with tempfile.TemporaryDirectory(dir=RUNS) as name, tempfile.TemporaryDirectory(dir=MEMORY) as memory:
        folder, mine, bare, unsynced, theirs, durable, pairs = Path(name), [], [], [], [], [], []
        looks = Looks()
        ours(folder)
        for _ in range(ROUNDS):  # in turns: a shared machine changes its speed within minutes
            mine.append(ours(folder))
            bare.append(bare_sync(folder))
            unsynced.append(ours(Path(memory)))
            with looks.can_be_off():
                durable.append(point_s(folder, looks)[True])
                pairs.append(point_s(Path(memory), looks))
            if peer:
                theirs.append(bluesky())
        (wall, processor), (_, alone) = middle(mine), middle(unsynced)
        point, sync = statistics.median(durable), statistics.median(bare)
        print(
            f"ours, one durable commit a point: {wall * 1e6:7.0f} us a point, {processor * 1e6:.0f} of processor time"
        )
        print(f"first quartile of points:         {point * 1e6:7.0f} us; of bare fdatasyncs of 2 kB {sync * 1e6:.0f}")
        print(f"run file in memory:               {alone * 1e6:7.0f} us of processor time a point")
        all_of_it, bare_of_it = (statistics.median(pair[on] for pair in pairs) for on in (True, False))
        cost = statistics.median(1.0 - pair[False] / pair[True] for pair in pairs)
        print(
            f"a point in memory, first quartile: {all_of_it * 1e6:.0f} us, without warnings, interlocks, "
            f"liveness and progress {bare_of_it * 1e6:.0f}: they cost {100 * cost:.0f} % of it"
        )
        beside = commits(folder)
        low, median = beside["ratio"]
        print(f"a commit over a bare fdatasync:   {median:7.2f} (medians; lowest tenths {low:.2f})")
        for key, value in syncs(folder).items():
            print(f"syncs of the {key} file a commit:   {value:7.3f}")
    if peer:
        seconds, took = middle(theirs)
        print(
            f"bluesky RunEngine, nothing stored:{seconds * 1e6:7.0f} us a point, {took * 1e6:.0f} of processor time: "
            f"{seconds / wall:.1f} times ours, by processor time {took / processor:.1f}, without the disk "
            f"{took / alone:.1f}"
        )


if __name__ == "__main__":
    main()
