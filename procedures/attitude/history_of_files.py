"""Calibrations for charts from stored files, the JSON of `fit_attitude` and `calibrate_package`.

Single replications are not stored. Stored are the mean squares between them for offset and sensitivity (sigma_b,
sigma_S) and for all parameters together; the last is used for rotations of the sensitive axis.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from fitter.arrays import FloatArray
from fitter.errors import FitError
from procedures.attitude.history import Calibrated, Warmth
from procedures.attitude.infer import AttitudeCalibration, SensorModel
from procedures.attitude.model import COLUMNS


def calibrated_from(content: Mapping[str, Any]) -> dict[str, Calibrated]:
    """Every sensor of a calibration file, by output column.

    Args:
        content: with "sensors", each as `AttitudeFit.to_dict`, and "calibration", as `AttitudeCalibration.to_dict`.

    Raises:
        FitError: the content is invalid, or has no error for charts.
    """
    package = AttitudeCalibration.from_dict(content["calibration"])
    keep = list(range(len(COLUMNS))) if package.roll else [0, 1, 3]
    found, start = {}, 0
    for sensor in package.sensors:
        size, at = sensor.coefficients.size, start
        block = package.covariance[start : start + size, start : start + size][np.ix_(keep, keep)]
        start += size
        try:
            fitted = content["sensors"][sensor.name]
            replications = fitted["df_bS"][0]
            shape = block / sensor.sigma_V**2
            replicated = replications > 0 and None not in (fitted["sigma_b"], fitted["sigma_S"], fitted["T_drift"])
            axis = sensor.coefficients[keep][1:]
            covariance = _between(fitted, shape, axis) if replicated else block
            found[sensor.name] = Calibrated(
                model=f"attitude-{sensor.axis}" if package.roll else "attitude-no-roll",
                coefficients=sensor.coefficients[keep],
                shape=shape,
                covariance=covariance,
                df=float(replications if replicated else sensor.df),
                replicated=replicated,
                sigma_V=sensor.sigma_V,
                df_sigma=sensor.df,
                pitch_range_deg=package.pitch_range_deg,
                warmth=_warmth(sensor, package.reference_degC, package.covariance[at:start, at:start], keep),
            )
        except (KeyError, TypeError, IndexError) as problem:
            raise FitError(f"{sensor.name} lacks or garbles {problem} of its analysis of variance") from problem
    return found


def _warmth(
    sensor: SensorModel, reference_degC: float | None, covariance: FloatArray, keep: list[int]
) -> Warmth | None:
    """From the temperature terms of offset and sensitivity, if the sensor has them."""
    linear = {powers: row for row, powers in enumerate(((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)))}
    turn = np.zeros((len(COLUMNS), len(sensor.terms)))
    for j, term in enumerate(sensor.terms):
        if term.degC == 1 and term.powers in linear:
            row = linear[term.powers]
            turn[row, j] = 1.0 if row < 2 else -1.0  # g_y and g_z are minus their columns
    if reference_degC is None or not np.any(turn):
        return None
    own = covariance[len(COLUMNS) :, len(COLUMNS) :]
    per_degC = turn @ sensor.coefficients[len(COLUMNS) :]
    return Warmth(reference_degC, per_degC[keep], (turn @ own @ turn.T)[np.ix_(keep, keep)])


def _between(fitted: Mapping[str, Any], shape: FloatArray, sensitivity: FloatArray) -> FloatArray:
    """(k, k) covariance from the variation between replications, with mean squares in place of one variance.

    Args:
        fitted: analysis of variance.
        shape: (k, k) (X'X)^-1.
        sensitivity: (k - 1,) coefficients after the offset.
    """
    k = len(shape)
    turn = np.eye(k)  # rows: offset, along the sensitivity, square to it
    turn[1:, 1:] = np.linalg.qr(np.column_stack([sensitivity, np.eye(k - 1)]))[0].T
    rest = fitted["T_drift"] * fitted["sigma_pr"] ** 2
    scale = np.sqrt(np.array([fitted["sigma_b"] ** 2, fitted["sigma_S"] ** 2, *[rest] * (k - 2)]))
    turned = scale[:, None] * (turn @ shape @ turn.T) * scale
    return np.asarray(turn.T @ turned @ turn)
