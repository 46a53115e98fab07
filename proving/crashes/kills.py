"""Real SIGKILLs of real controllers: start, kill at a random moment, resume, kill again, and count what is left.

The quick tests make a few kills, `python -m proving crashes kills` many.
"""

from __future__ import annotations

import random
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rig.examples import example
from rig.procedures.plan.run_list import RunList
from rig.run_file.read.reader import RunReader

ATTITUDE = """
kind = "pitch-roll"
name = "kills"
replications = {replications}
[design]
type = "D1"
pitch_max_deg = 90
pitch_count = 13
roll_count = 13
[settle]
dwell_s = 1
[measure]
readings = 4
"""

PRESSURE = """
kind = "whole-plot"
name = "kills"
seed = 5
replications = {replications}
[design]
type = "list"
temperatures_degC = [[10, 20], [20, 10], [20, 30], [30, 20], [15, 15]]
pressures_psia = [0.12, 0.5, 1.0, 2.5]
repeated_psia = [0.5]
[model]
formula = "1 + P"
[soak]
dwell_s = 120
drift_degC_per_h = 5
[settle]
dwell_s = 4
[measure]
readings = 2
"""

PROCEDURES = {"attitude": ATTITUDE, "pressure": PRESSURE}


@dataclass
class Tally:
    """What a campaign has come to."""

    runs: int = 0
    kills: int = 0
    points: int = 0
    lost: int = 0
    duplicated: int = 0
    wrong_side: int = 0

    def add(self, other: Tally) -> None:
        """Add what another run has come to."""
        for name in vars(self):
            setattr(self, name, getattr(self, name) + getattr(other, name))


def rig(*arguments: object, **options: Any) -> subprocess.Popen[str]:
    """Start a command in a process of its own; options are those of `Popen`."""
    command = [sys.executable, "-m", "rig", *map(str, arguments)]
    return subprocess.Popen(command, text=True, stderr=subprocess.PIPE, stdout=subprocess.PIPE, **options)


def wait_for(condition: Callable[[], object], process: subprocess.Popen[str], seconds: float = 40.0) -> None:
    """Wait in real time for what another process does; it must live meanwhile."""
    end = time.monotonic() + seconds  # noqa: TID251 - two processes in real time
    while not condition():
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < end, "waited too long"  # noqa: TID251
        time.sleep(0.02)  # noqa: TID251


def one_run(
    folder: Path, seed: int, *, kills: int, longest_s: float, replications: int = 8, lab: str = "attitude"
) -> Tally:
    """Kill a run up to `kills` times, each at most `longest_s` after its start, then let it finish and judge it."""
    rng = random.Random(seed)
    procedure = folder / f"kills-{seed}.toml"
    procedure.write_text(PROCEDURES[lab].format(replications=replications))
    bench, world = (example(f"{lab}-lab") / name for name in ("bench.toml", "world.toml"))
    process = rig("run", procedure, "--bench", bench, "--dry", "--world", world, "--out", folder)
    assert process.stdout is not None
    line = process.stdout.readline()
    assert line, process.communicate()
    path = Path(line.strip())
    tally = Tally(runs=1)
    while True:
        try:
            delay = rng.uniform(0, longest_s) if tally.kills < kills else 60.0
            process.wait(delay)
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGKILL)
            process.wait()
            process.communicate()
            tally.kills += 1
            process = rig("resume", path)
            continue
        _, said = process.communicate()
        assert process.returncode == 0, f"seed {seed}: exit {process.returncode}: {said}"
        break
    tally.add(judge(path))
    return tally


def judge(path: Path) -> Tally:
    """Hold a finished run file against its run list. In whole plots a point counts once for each identity."""
    with RunReader.open(path) as reader:
        reader.verify()
        run_list: RunList = reader.run_list()
        accepted = [r for r in reader.records("observation") if r.status == "accepted"]
    counts = Counter((r.whole_plot, r.run_index) for r in accepted)
    observed = {r.run_index for r in accepted}
    wrong = 0
    for record in accepted:
        assert record.run_index is not None
        point = run_list.points[record.run_index]
        for factor, side, setpoint in zip(run_list.factors, point.sides, point.setpoints, strict=True):
            if not side:
                continue
            arrived, start = record.data["approach"][factor.axis]
            if arrived != side or (setpoint - start) * side < factor.overtravel - 0.01:
                wrong += 1
    return Tally(
        points=len(run_list),
        lost=sum(p.index not in observed for p in run_list.points),
        duplicated=sum(n - 1 for n in counts.values()),
        wrong_side=wrong,
    )
