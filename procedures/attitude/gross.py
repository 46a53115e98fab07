"""Gross errors of a pitch-roll calibration.

Readings are compared with a model for each replication where that holds, otherwise with those of the same point in
other replications. So effects common to a point (pads, head errors) or to a replication (drift) are not gross errors.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from rig.fitter.gross import GrossErrors, with_repeats
from rig.fitter.gross.rows import Rows
from rig.fitter.own_span import AT_ONCE, NO_GROUP
from rig.fitter.resolution import resolution
from rig.procedures.attitude.model import attitude_columns, fit_columns

if TYPE_CHECKING:
    from rig.fitter.arrays import FloatArray
    from rig.procedures.attitude.data import AttitudeData

REPEATS = 3
"""Minimum readings of one point for a comparison with one another instead of with the model."""

STEP_DEG = 0.1
STEPS_DEG = ((STEP_DEG, 0.0), (0.0, STEP_DEG))
"""Moves in pitch and roll by which slopes are found."""


def of_attitude(data: AttitudeData) -> Mapping[str, GrossErrors]:
    """By sensor of a pitch-roll calibration."""
    columns, n = data.rows.columns, len(data)
    visits = np.bincount(data.point)[data.point]
    own = visits >= REPEATS
    group = np.full(len(data), NO_GROUP, np.int64)
    group[own] = np.unique(data.point[own], return_inverse=True)[1]
    zero, one = np.broadcast_to(0.0, n), np.broadcast_to(1.0, n)
    declared = Rows(columns, zero, one, np.full(n, NO_GROUP, np.int64), data.replicate_index)
    levels = Rows(columns, zero, one, group, data.replicate_index)
    found = {}
    for name, y in data.outputs.items():
        model = declared.of(y)
        found[name] = with_repeats(
            model,
            levels.of(y),
            group,
            step=resolution(y),
            responses=len(data.outputs),
            drivers=_drivers(data, model),
            designed=True,
        )
    return found


def _drivers(data: AttitudeData, rows: Rows) -> dict[str, FloatArray]:
    """Quantities that the standard deviation of an output may grow with, by a fit that a few bad rows do not pull."""
    columns, n = rows.columns, len(rows.y)
    fit = fit_columns(columns, rows.y - rows.least_absolute)
    output, slope = fit.predict(columns), np.empty(n)
    for first in range(0, n, AT_ONCE):
        some = slice(first, first + AT_ONCE)
        moved = (
            attitude_columns(data.pitch_deg[some] + a, data.roll_deg[some] + r, roll=data.has_roll)
            for a, r in STEPS_DEG
        )
        slope[some] = np.hypot(*(fit.predict(one) - output[some] for one in moved))
    return {"slope": slope, "output": np.abs(output)}
