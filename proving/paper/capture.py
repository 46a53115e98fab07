"""A calibration of the paper, carried out dry by the real controller, and its data as arrays."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from proving.paper.nights import Night
from rig.engine.session import Outcome, Progress, Signals
from rig.errors import RigError
from rig.files.atomic import write_whole
from rig.procedures.attitude.data import SAME_ANGLE_DEG, AttitudeData
from rig.procedures.attitude.designs import Design
from rig.procedures.attitude.infer import calibrate_package
from rig.procedures.attitude.table import attitude_data
from rig.runs.controller import start_run
from rig.runs.plans import load_plan
from rig.tables.table_of_run import run_table


def capture(night: Night, folder: Path, seed: int, on_progress: Callable[[Progress], None]) -> AttitudeData:
    """Run one night in virtual time.

    Args:
        night: what is run.
        folder: for its bench, procedure, world and run file.
        seed: of the simulated noise.
        on_progress: called with the sequencer's news.

    Raises:
        RigError: the run did not complete.

    """
    bench = _written(folder / "bench.toml", night.bench_text())
    procedure = _written(folder / "procedure.toml", night.procedure_text())
    world = _written(folder / "world.toml", night.world_text(seed))
    plan = load_plan(procedure, bench, dry=True, world=world)
    run_files: list[Path] = []
    result = start_run(plan, folder, signals=Signals(), announce=run_files.append, on_progress=on_progress)
    if result.outcome is not Outcome.COMPLETE:
        raise RigError(f"the simulated night {night.name} did not complete: {result.message}")
    data = attitude_data(run_table(run_files[0]))
    return data if night.order == "serpentine" else data.take(np.flatnonzero(~_turning(data)))


def temperature_corrected(data: AttitudeData) -> AttitudeData:
    """Outputs less what follows the temperature, offset and sensitivity fitted as linear in it beside the model."""
    assert data.sensor_temperature_degC is not None
    calibration = calibrate_package(data, temperature=True)
    assert calibration.reference_degC is not None
    warmth = data.sensor_temperature_degC - calibration.reference_degC
    return replace(
        data, outputs={s.name: data.outputs[s.name] - s.beyond(data.g_M.T, warmth) for s in calibration.sensors}
    )


def at_points(data: AttitudeData, design: Design) -> AttitudeData:
    """The observations at the points of a smaller design; of a pass up and back, those on the way up.

    Raises:
        ValueError: a point of the design was never visited.

    """
    points = np.array(design.points_deg())
    visited = np.column_stack([data.pitch_deg, data.roll_deg])
    apart = np.abs(visited[:, None, :] - points[None, :, :]).max(axis=2)
    same = apart < SAME_ANGLE_DEG
    if not same.any(axis=0).all():
        raise ValueError(f"{design.name}: not every point of it is among those that were measured")
    rows = same.any(axis=1)
    return data.take(np.flatnonzero(rows if data.has_roll else rows & (data.pitch_side > 0)))


def _written(path: Path, text: str) -> Path:
    write_whole(path, lambda file: file.write(text))
    return path


def _turning(data: AttitudeData) -> NDArray[np.bool_]:
    """(n,) whether a row is the second reading at the angle where a pass up and back turns: the paper has one."""
    return np.asarray((data.pitch_deg > data.pitch_deg.max() - SAME_ANGLE_DEG) & (data.pitch_side < 0))
