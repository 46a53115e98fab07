"""Expected readings of attitude sensors on a bench: by an earlier calibration, or by the declared model."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.procedures.attitude.infer import AttitudeCalibration
from rig.procedures.attitude.model import attitude_columns, mounting_matrix
from rig.procedures.plan.expected import Columns, Expected, Expecting

PITCH, ROLL, SENSOR = "pitch_deg", "roll_deg", "sensor_temperature_degC"
_TO_GRAVITY = np.array([1.0, -1.0, -1.0])


def expecting(calibration: AttitudeCalibration) -> Expecting:
    """Expected readings of the sensors of a bench, for `rig.procedures.kind.Kind.expecting`."""
    return partial(expected, calibration)


def expected(calibration: AttitudeCalibration, columns: Columns, mounting: Mapping[str, float]) -> dict[str, Expected]:
    """Expected readings of the sensors of a bench, by a calibration of the package."""
    if PITCH not in columns or ROLL not in columns:
        return {}
    g = attitude_columns(columns[PITCH], columns[ROLL])[:, 1:] * _TO_GRAVITY
    turns = [float(mounting.get(f"{axis}_deg", 0.0)) for axis in "xyz"]
    if any(turns):
        g = g @ mounting_matrix(*turns).T
    warmth = np.zeros(len(g))
    if calibration.reference_degC is not None:
        warmth = columns.get(SENSOR, np.full(len(g), np.nan)) - calibration.reference_degC
    found, first = {}, 0
    for sensor, sigma in zip(calibration.sensors, calibration.sigma_V, strict=True):
        rows, k = sensor.rows(g.T, warmth), sensor.coefficients.size
        block = calibration.use_covariance[first : first + k, first : first + k]
        first += k
        shared = np.sqrt(np.maximum(np.einsum("kn,kl,ln->n", rows, block, rows), 0.0))
        df = sensor.df if calibration.drift is None else calibration.drift.df
        found[sensor.name] = Expected(sensor.coefficients @ rows, np.full(len(g), sigma), shared, df, k)
    return found


def model_columns(columns: Columns, declared: Mapping[str, Any]) -> FloatArray | None:
    """(n, k) columns of the declared model; None if pitch and roll are unknown.

    A turned mounting changes the coefficients, not the span of the columns, so residuals do not depend on it. With
    temperature in the declared model every column is repeated, times the sensors' temperature.
    """
    if PITCH not in columns or ROLL not in columns:
        return None
    found = attitude_columns(columns[PITCH], columns[ROLL])
    if declared.get("temperature") and SENSOR in columns:
        found = np.column_stack([found, found * (columns[SENSOR] - np.nanmean(columns[SENSOR]))[:, None]])
    return found
