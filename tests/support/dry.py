"""Dry runs of the example bench for tests: a short procedure, and what went over the wires."""

from __future__ import annotations

import hashlib
import json
import sys
from pathlib import Path
from unittest.mock import patch

from rig.engine.session import Outcome, Signals
from rig.examples import example
from rig.runs.controller import start_run
from rig.runs.plans import load_plan
from rig.simulated import dry_run
from rig.tables.table_of_run import run_table

LAB = example("attitude-lab")

SHORT = """
kind = "pitch-roll"
name = "short"
seed = 5
replications = 2
[design]
type = "D"
pitch_deg = [-90, -45, 0, 45, 90]
roll_deg = [-120, 0, 120]
[settle]
dwell_s = 2
[measure]
readings = 4
[environment]
setpoint_degC = 23
dwell_s = 60
"""


def write_short(folder: Path, text: str = SHORT) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "short.toml"
    path.write_text(text)
    return path


def dry(folder: Path, *, bench: Path = LAB / "bench.toml", world: Path = LAB / "world.toml", text: str = SHORT) -> Path:
    """Run a procedure dry; the run file."""
    plan = load_plan(write_short(folder, text), bench, dry=True, world=world)
    paths: list[Path] = []
    result = start_run(plan, folder, signals=Signals(), announce=paths.append, on_progress=lambda _: None)
    assert result.outcome is Outcome.COMPLETE, result.message
    return paths[0]


def fingerprint(folder: Path, **options: Path) -> dict[str, str]:
    """Hash of every byte on every wire with its instrument and direction, and of all observations."""
    wires = hashlib.sha256()
    transfers = 0

    def tap(instrument: str, direction: str, data: bytes) -> None:
        nonlocal transfers
        transfers += 1
        wires.update(f"{instrument} {direction} {len(data)} ".encode() + data)

    original = dry_run.DryBench.__init__

    def tapped(self, *args, **kwargs):  # type: ignore[no-untyped-def]
        original(self, *args, **kwargs, tap=tap)

    with patch.object(dry_run.DryBench, "__init__", tapped):
        path = dry(folder, text=SHORT.replace("replications = 2", "replications = 1"), **options)
    table = run_table(path)
    observations = hashlib.sha256(json.dumps([values.tolist() for values in table.columns.values()]).encode())
    return {"wires": wires.hexdigest(), "observations": observations.hexdigest(), "transfers": str(transfers)}


if __name__ == "__main__":
    print(json.dumps(fingerprint(Path(sys.argv[1]))))
