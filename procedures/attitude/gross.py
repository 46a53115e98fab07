"""Gross errors of a pitch-roll calibration.

Readings of one point are compared over replications, with a model for each replication. So effects common to a point
(pads, head errors) or to a replication (drift) are not gross errors.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fitter.arrays import FloatArray
from fitter.gross import GrossErrors, gross_errors
from fitter.gross.rows import NO_GROUP, Rows
from fitter.resolution import resolution
from fitter.sums_of_squares import own_parameters
from procedures.attitude.data import AttitudeData
from procedures.attitude.model import attitude_columns, fit_columns

REPEATS = 3
"""Minimum readings of one point for a comparison with one another instead of with the model."""


STEP_DEG = 0.1


def of_attitude(data: AttitudeData) -> Mapping[str, GrossErrors]:
    """By sensor of a pitch-roll calibration."""
    columns = attitude_columns(data.pitch_deg, data.roll_deg, roll=data.has_roll)
    visits = np.bincount(data.point)[data.point]
    own = visits >= REPEATS
    group = np.full(len(data), NO_GROUP, np.int64)
    group[own] = np.unique(data.point[own], return_inverse=True)[1]
    drivers = {name: _drivers(data, columns, y) for name, y in data.outputs.items()}
    rows = Rows.equal(own_parameters(columns, data.replicate_index), group)
    del columns
    return {
        name: gross_errors(
            y,
            rows.columns,
            group=group,
            step=resolution(y),
            responses=len(data.outputs),
            drivers=drivers[name],
            designed=True,
            rows=rows,
        )
        for name, y in data.outputs.items()
    }


def _drivers(data: AttitudeData, columns: FloatArray, y: FloatArray) -> dict[str, FloatArray]:
    """Quantities that the standard deviation of an output may grow with."""
    fit = fit_columns(columns, y)
    output = fit.predict(columns)
    steps = ((STEP_DEG, 0.0), (0.0, STEP_DEG))
    moved = (attitude_columns(data.pitch_deg + a, data.roll_deg + r, roll=data.has_roll) for a, r in steps)
    return {"slope": np.hypot(*(fit.predict(one) - output for one in moved)), "output": np.abs(output)}
