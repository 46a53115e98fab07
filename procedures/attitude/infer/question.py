"""Quantities given beside the outputs, the questions to a chunk of readings, and what a package at rest determines."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rig.fitter.arrays import FloatArray
from rig.fitter.errors import FitError
from rig.fitter.quantiles import f_limit
from rig.procedures.attitude.infer import two_axis
from rig.procedures.attitude.infer.calibration import AttitudeCalibration
from rig.procedures.attitude.infer.package import Noise, gravity
from rig.procedures.attitude.infer.singular import normal
from rig.procedures.attitude.infer.tangent import Tangent


def noise_of(calibration: AttitudeCalibration, noise_sd_V: ArrayLike | None) -> Noise:
    """Noise of new readings: known, (S,) or one for all, V, or that of the calibration."""
    if noise_sd_V is None:
        return Noise(calibration.sigma_V**2, of_fit=True)
    sd = np.broadcast_to(np.asarray(noise_sd_V, np.float64), (len(calibration.sensors),))
    if not np.all((sd > 0) & np.isfinite(sd)):
        raise FitError("noise_sd_V: the standard deviation of a reading is a positive number")
    return Noise(sd**2, of_fit=False)


def near_of(
    matrix: FloatArray, near_deg: tuple[ArrayLike, ArrayLike] | None, n: int, *, free: bool
) -> tuple[FloatArray, FloatArray, NDArray[np.bool_]]:
    """(n,) pitch and (n,) roll in rad near the expected attitude, and (n,) whether it is beyond +-90 deg of pitch;
    `free` if roll is inferred too.

    Raises:
        FitError: two sensors' solutions are equally near, or neither is the usual one.
    """
    usual = two_axis.default_near(matrix) if near_deg is None and free and len(matrix) == 2 else (0.0, 0.0)
    given = usual if near_deg is None else tuple(np.radians(np.asarray(value, np.float64)) for value in near_deg)
    pitch, roll = (np.asarray(value) for value in given)
    over = np.asarray(np.cos(pitch) < 0)
    near = each("near_deg", pitch, n), each("near_deg", roll, n)
    if near_deg is not None:
        if not (np.isfinite(pitch).all() and np.isfinite(roll).all()):
            raise FitError("near_deg: an attitude to look near is two finite numbers")
        if free and len(matrix) == 2:
            beside = np.abs(normal(matrix) @ gravity(*near)) < 1e-6
            if beside.any():
                raise FitError("near_deg: it lies between the two solutions and selects neither")
    return *near, np.broadcast_to(over, (n,))


def each(name: str, values: ArrayLike, n: int) -> FloatArray:
    """(n,) values from one value or n."""
    array = np.asarray(values, np.float64)
    if array.shape not in ((), (1,), (n,)):
        raise ValueError(f"{name}: expected one value, or {n}, found shape {array.shape}")
    return np.broadcast_to(array, (n,))


_LEVEL_ABSURD = 1.0 - 1e-6


@dataclass(frozen=True, eq=False)
class Question:
    """Readings of one chunk: (S, n) outputs minus offsets, (n,) or None the rest; angles in rad. `over` is whether the
    near pitch is beyond +-90 deg, `worse` that of `worse_at_most`, `absurd` that of `absurd_squares`; `tangent` is None
    if roll is known.
    """

    calibration: AttitudeCalibration
    noise: Noise
    weights: FloatArray
    y: FloatArray
    warmth: FloatArray
    near_pitch: FloatArray
    near_roll: FloatArray
    over: NDArray[np.bool_]
    roll: FloatArray | None
    roll_variance: FloatArray
    weighed: bool
    worse: float
    absurd: float
    tangent: Tangent | None


def beyond(q: Question, g: FloatArray) -> FloatArray | None:
    """(S, n) contribution of effects and temperature to the outputs; None if the calibration has none."""
    if all(not s.terms for s in q.calibration.sensors):
        return None
    return np.stack([s.beyond(g, q.warmth) for s in q.calibration.sensors])


def worse_at_most(calibration: AttitudeCalibration, noise: Noise) -> float:
    """Maximum factor of an output's variance due to the calibration (eq. 73): at least one."""
    worst, at = 1.0, 0
    for sensor, variance in zip(calibration.sensors, noise.variance, strict=True):
        k = sensor.coefficients.size
        own = calibration.use_covariance[at : at + k, at : at + k]
        worst = max(worst, 1.0 + 2.0 * float(np.linalg.eigvalsh(own)[-1]) / float(variance))
        at += k
    return worst


def f_absurd(above: int, calibration: AttitudeCalibration) -> float:
    """Limit of F for a package at rest, unchanged since its calibration."""
    return f_limit(_LEVEL_ABSURD, above, float(calibration.sigma_df.min()))


def absurd_squares(calibration: AttitudeCalibration, worse: float, *, free: bool) -> float:
    """Limit of the remaining weighted squares beyond which a package is not at rest, or has changed; `worse` is that of
    `worse_at_most`, `free` whether roll is inferred.
    """
    above = max(len(calibration.sensors) - (2 if free else 1), 1)
    return above * f_absurd(above, calibration) * worse
