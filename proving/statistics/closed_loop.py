"""The closed loop through the whole bench: is what was hidden found, and nothing else?

Every seed is a full dry run of the attitude laboratory: drivers, bytes, twins, sequencer, run file; then the trace.
"""

from __future__ import annotations

import tempfile
from functools import partial
from pathlib import Path

from proving.frame import Figures, Part, Results, Study
from proving.ledger import Result
from proving.statistics.dry_runs import dry
from rig.by_kind import trace_table
from rig.examples import example
from rig.procedures.attitude.evaluate import AttitudeTraced
from rig.runs.plans import load_plan
from rig.tables.table_of_run import run_table

LAB = example("attitude-lab")
HIDDEN = {"isolation-pad-deflection", "sensitivity-temperature"}


def hidden() -> Study:
    """The example's world, night.toml: both hidden effects named, and anything besides."""
    return Study({"night.toml": partial(_found, hidden=True)}, _named)


def clean() -> Study:
    """Nothing hidden, procedure.toml: anything reported on any sensor."""
    return Study({"procedure.toml": partial(_found, hidden=False)}, _reported)


def _found(seed: int, *, hidden: bool) -> Result:
    """Effects by sensor that the trace reports after one dry run."""
    text = (LAB / "world.toml").read_text().replace("seed = 20260115", f"seed = {seed}")
    if not hidden:
        text = text[: text.index("# What nobody declared")]
    with tempfile.TemporaryDirectory() as folder:
        world = Path(folder) / "world.toml"
        world.write_text(text)
        procedure = LAB / ("night.toml" if hidden else "procedure.toml")
        plan = load_plan(procedure, LAB / "bench.toml", dry=True, world=world)
        traced = trace_table(run_table(dry(plan, Path(folder))))
    assert isinstance(traced, AttitudeTraced)
    sensors = traced.trace.sensors.items()
    return {"seed": seed, "effects": {name: sorted({e.effect for e in sensor.added}) for name, sensor in sensors}}


def _every(one: Result) -> set[str]:
    return {effect for effects in one["effects"].values() for effect in effects}


def _named(results: Results) -> Figures:
    wrong = {f"seed {one['seed']}": one["effects"] for one in results if _every(one) != HIDDEN}
    return {
        "both named": sum(_every(one) >= HIDDEN for one in results),
        "besides": sum(bool(_every(one) - HIDDEN) for one in results),
        "of": len(results),
        "otherwise": wrong,
    }


def _reported(results: Results) -> Figures:
    wrong = {f"seed {one['seed']}": one["effects"] for one in results if _every(one)}
    return {"reported": len(wrong), "of": len(results), "in": wrong}


PARTS = {"hidden": Part(hidden, 20, 1), "clean": Part(clean, 20, 1)}
