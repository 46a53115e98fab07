"""Our own time per point, with a durable commit, beside bluesky's RunEngine, which stores nothing.

Both run 2,886 points on instruments that answer at once, in the same process, in turn; also what the file system asks
for one fdatasync of a record's size. What a commit takes beside it: `benchmarks.load commit`.

    .venv/bin/python -m benchmarks.bench_engine
"""

from __future__ import annotations

import importlib.util
import os
import statistics
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent / "tests" / "support"))
sys.path.insert(0, str(Path(__file__).parent.parent))

import ideal_bench

from benchmarks.scratch import RUNS
from rig.procedures.attitude.settings import PitchRollProcedure

MEMORY = Path("/dev/shm") if Path("/dev/shm").is_dir() else None
POINTS = 2886
ROUNDS = 3


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


def middle(times: list[tuple[float, float]]) -> tuple[float, float]:
    """Medians of wall and processor time."""
    wall, processor = (statistics.median(column) for column in zip(*times, strict=True))
    return wall, processor


def main() -> None:
    peer = importlib.util.find_spec("bluesky") is not None
    if not peer:
        print("bluesky is not installed: pip install -e '.[bench]'")
    with tempfile.TemporaryDirectory(dir=RUNS) as name, tempfile.TemporaryDirectory(dir=MEMORY) as memory:
        mine, bare, unsynced, theirs = [], [], [], []
        ours(Path(name))
        for _ in range(ROUNDS):  # in turns: a shared machine changes its speed within minutes
            mine.append(ours(Path(name)))
            bare.append(bare_sync(Path(name)))
            unsynced.append(ours(Path(memory)))
            if peer:
                theirs.append(bluesky())
    (wall, processor), (_, alone), sync = middle(mine), middle(unsynced), statistics.median(bare)
    print(f"ours, one durable commit a point: {wall * 1e6:7.0f} us a point, {processor * 1e6:.0f} of processor time")
    print(f"of bare fdatasyncs of 2 kB:       {sync * 1e6:7.0f} us, the first quartile")
    print(f"run file in memory:               {alone * 1e6:7.0f} us of processor time a point")
    if peer:
        seconds, took = middle(theirs)
        print(
            f"bluesky RunEngine, nothing stored:{seconds * 1e6:7.0f} us a point, {took * 1e6:.0f} of processor time: "
            f"{seconds / wall:.1f} times ours, by processor time {took / processor:.1f}, without the disk "
            f"{took / alone:.1f}"
        )


if __name__ == "__main__":
    main()
