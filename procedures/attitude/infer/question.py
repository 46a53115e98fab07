"""Quantities given beside the outputs, the questions to a chunk of readings, and what a package at rest determines."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fitter.arrays import FloatArray
from fitter.errors import FitError
from fitter.quantiles import f_limit
from procedures.attitude.infer import two_axis
from procedures.attitude.infer.calibration import AttitudeCalibration
from procedures.attitude.infer.package import Noise, gravity
from procedures.attitude.infer.singular import normal


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
) -> tuple[FloatArray, FloatArray]:
    """(n,) pitch and (n,) roll in rad near the expected attitude; `free` if roll is inferred too.

    Raises:
        FitError: two sensors' solutions are equally near, or neither is the usual one.
    """
    if near_deg is not None:
        pitch, roll = (np.radians(each("near_deg", value, n)) for value in near_deg)
        if not (np.isfinite(pitch).all() and np.isfinite(roll).all()):
            raise FitError("near_deg: an attitude to look near is two finite numbers")
        if free and len(matrix) == 2:
            beside = np.abs(normal(matrix) @ gravity(pitch, roll)) < 1e-6
            if beside.any():
                raise FitError("near_deg: it lies between the two solutions and selects neither")
        return pitch, roll
    pitch_0, roll_0 = two_axis.default_near(matrix) if free and len(matrix) == 2 else (0.0, 0.0)
    return np.full(n, pitch_0), np.full(n, roll_0)


def each(name: str, values: ArrayLike, n: int) -> FloatArray:
    """(n,) values from one value or n."""
    array = np.asarray(values, np.float64)
    if array.shape not in ((), (1,), (n,)):
        raise ValueError(f"{name}: expected one value, or {n}, found shape {array.shape}")
    return np.broadcast_to(array, (n,))


_LEVEL_ABSURD = 1.0 - 1e-6


@dataclass(frozen=True, eq=False)
class Question:
    """Readings of one chunk: (S, n) outputs minus offsets, (n,) or None the rest; angles in rad. `worse` is that of
    `worse_at_most`.
    """

    calibration: AttitudeCalibration
    noise: Noise
    weights: FloatArray
    y: FloatArray
    warmth: FloatArray
    near_pitch: FloatArray
    near_roll: FloatArray
    roll: FloatArray | None
    roll_variance: FloatArray
    weighed: bool
    worse: float


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


def f_absurd(above: int, q: Question) -> float:
    """Limit of F for a package at rest, unchanged since its calibration."""
    return f_limit(_LEVEL_ABSURD, above, float(q.calibration.sigma_df.min()))


def absurd_squares(q: Question) -> float:
    """Limit of the remaining weighted squares beyond which a package is not at rest, or has changed."""
    above = max(len(q.y) - (2 if q.roll is None else 1), 1)
    return above * f_absurd(above, q) * q.worse
