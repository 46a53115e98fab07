"""Eight dry runs side by side, each a process of its own, beside the same runs one after the other.

Every run has a world of its own, so no two of them answer alike by chance. They do not disturb each other if each of
them records what it records alone: the same records in the same order, but for dates and the identity of the process.
Other work on the machine changes the wall time of both, so the processor time of all runs is shown too: side by side a
run may cost more of it (caches, memory, locks), and throughput on `cores` idle cores cannot be more than `cores` times
the ratio.

    .venv/bin/python -m benchmarks.bench_side_by_side [--runs 8]
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from benchmarks.scratch import RUNS
from rig.engine.session import Outcome, Signals
from rig.examples import example
from rig.run_file.events.sessions import SessionBegan
from rig.run_file.read.reader import RunReader
from rig.runs.controller import start_run
from rig.runs.plans import load_plan

_NIGHT = """kind = "pitch-roll"
name = "side-by-side"
replications = 2
[design]
type = "D1"
pitch_max_deg = 60
pitch_count = 13
roll_count = 13
[settle]
dwell_s = 1.0
"""


def one(number: int, folder: Path) -> str:
    """A run; returns a digest of what it recorded."""
    lab, world, procedure = example("attitude-lab"), folder / "world.toml", folder / "procedure.toml"
    world.write_text(f"seed = {number}\n")
    procedure.write_text(_NIGHT)
    plan = load_plan(procedure, lab / "bench.toml", dry=True, world=world)
    result = start_run(plan, folder, signals=Signals(), announce=lambda _: None, on_progress=lambda _: None)
    assert result.outcome is Outcome.COMPLETE, result.message
    found = hashlib.sha256()
    with RunReader.open(result.path) as run:
        for record in run.records():
            if record.kind not in (SessionBegan.kind, "run", "end"):  # process, machine, name, head of the chain
                found.update(json.dumps([*record[:3], *record[4:]]).encode())
    return found.hexdigest()


def together(numbers: list[int]) -> tuple[float, float, list[str]]:
    """(wall seconds, processor seconds, digests) of runs that start together."""
    before, began = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    command = [sys.executable, "-m", "benchmarks.bench_side_by_side", "--one"]
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1"}
    processes = [
        subprocess.Popen([*command, str(n)], stdout=subprocess.PIPE, text=True, env=environment) for n in numbers
    ]
    said = [process.communicate()[0].strip() for process in processes]
    wall, after = time.perf_counter() - began, resource.getrusage(resource.RUSAGE_CHILDREN)
    assert not any(process.returncode for process in processes)
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, said


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=8)
    parser.add_argument("--one", type=int, default=None, help=argparse.SUPPRESS)
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory(dir=RUNS) as name:
        if asked.one is not None:
            print(one(asked.one, Path(name)))
            return
    numbers = list(range(1, asked.runs + 1))
    alone = [together([n]) for n in numbers]
    wall, processor, said = together(numbers)
    alone_wall, alone_processor = sum(a[0] for a in alone), sum(a[1] for a in alone)
    same = sum(a[2] == [digest] for a, digest in zip(alone, said, strict=True))
    cores = os.cpu_count() or 1
    print(f"one after the other: {alone_wall:.1f} s, {alone_processor:.1f} s of processor time")
    print(f"side by side: {wall:.1f} s, {processor:.1f} s of processor time, on {cores} cores")
    print(f"throughput by wall time: {alone_wall / wall:.2f} times one run's")
    print(f"throughput by processor time: at most {cores * alone_processor / processor:.2f} times one run's")
    print(f"records as of the run alone: {same} of {len(numbers)}")


if __name__ == "__main__":
    main()
