"""Gross errors of a pitch-roll calibration.

Readings of one point are compared over replications, with a model for each replication. So effects common to a point
(pads, head errors) or to a replication (drift) are not gross errors.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fitter.gross import GrossErrors, gross_errors
from fitter.gross.rows import NO_GROUP
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
    by_replication = own_parameters(columns, data.replicate_index)
    visits = np.bincount(data.point)[data.point]
    own = visits >= REPEATS
    group = np.full(len(data), NO_GROUP, np.int64)
    group[own] = np.unique(data.point[own], return_inverse=True)[1]
    found = {}
    for name, y in data.outputs.items():
        fit = fit_columns(columns, y)
        ahead = attitude_columns(data.pitch_deg + STEP_DEG, data.roll_deg, roll=data.has_roll)
        aside = attitude_columns(data.pitch_deg, data.roll_deg + STEP_DEG, roll=data.has_roll)
        slope = np.hypot(*(fit.predict(moved) - fit.predict(columns) for moved in (ahead, aside)))
        found[name] = gross_errors(
            y,
            by_replication,
            group=group,
            step=resolution(y),
            responses=len(data.outputs),
            drivers={"slope": slope, "output": np.abs(fit.predict(columns))},
            designed=True,
        )
    return found
