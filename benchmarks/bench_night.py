"""The example night through every byte of every protocol: seconds, exchanges, microseconds an exchange.

Wall time on a shared machine is mostly other people's: processor time, all of it in this process, is shown beside it.

    .venv/bin/python benchmarks/bench_night.py [--lab pressure] [--poll 0.1]

A shorter poll makes more exchanges a point: on the attitude bench 0.1 s gives well over a hundred.
"""

from __future__ import annotations

import argparse
import os
import statistics
import tempfile
import time
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from benchmarks.scratch import RUNS
from rig.engine.session import Signals
from rig.examples import example
from rig.runs.controller import start_run
from rig.runs.plans import load_plan
from rig.simulated import dry_run

NIGHTS = {"attitude": ("attitude-lab", "night.toml", 0.5), "pressure": ("pressure-lab", "procedure.toml", 2.0)}
"""Folder, procedure, and its seconds between readbacks."""


def night(lab: str, poll_s: float, *, counted: bool) -> tuple[tuple[float, float], int, int]:
    """(wall and processor seconds, questions and commands sent, points) of one dry run."""
    sent = 0

    def tap(_instrument: str, direction: str, _data: bytes) -> None:
        nonlocal sent
        sent += direction == "tx"

    original = dry_run.DryBench.__init__
    if counted:

        def tapped(self, *args, **kwargs):
            original(self, *args, **kwargs, tap=tap)

        dry_run.DryBench.__init__ = tapped
    try:
        with tempfile.TemporaryDirectory(dir=RUNS) as folder:
            files, night_toml, _ = NIGHTS[lab]
            here = example(files)
            procedure = Path(folder) / "night.toml"
            text = (here / night_toml).read_text().replace("[settle]\n", f"[settle]\npoll_s = {poll_s}\n")
            procedure.write_text(text)
            plan = load_plan(procedure, here / "bench.toml", dry=True, world=here / "world.toml")
            began, before = time.perf_counter(), time.process_time()
            start_run(plan, Path(folder), signals=Signals(), announce=lambda _: None, on_progress=lambda _: None)
            seconds = time.perf_counter() - began, time.process_time() - before
            return seconds, sent, len(plan.run_list)
    finally:
        dry_run.DryBench.__init__ = original


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--lab", choices=NIGHTS, default="attitude")
    parser.add_argument("--poll", type=float, default=None, help="seconds between readbacks")
    asked = parser.parse_args()
    poll_s = NIGHTS[asked.lab][2] if asked.poll is None else asked.poll
    _, sent, points = night(asked.lab, poll_s, counted=True)
    took = [night(asked.lab, poll_s, counted=False)[0] for _ in range(3)]
    wall, processor = (statistics.median(column) for column in zip(*took, strict=True))
    print(
        f"{points} points, {sent / points:.0f} exchanges a point: {processor:.2f} s of processor time, {wall:.2f} s "
        f"(medians of 3)"
    )
    each = f"{1e6 * processor / sent:.1f} us of processor time, {1e6 * wall / sent:.1f} us an exchange"
    print(f"{each}, everything included (twins, physics, sequencer, run file)")


if __name__ == "__main__":
    main()
