"""Request for one chunk of readings, and limits for a package at rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fitter.arrays import FloatArray
from fitter.quantiles import f_limit
from procedures.attitude.infer.calibration import AttitudeCalibration
from procedures.attitude.infer.package import Noise

_LEVEL_ABSURD = 1.0 - 1e-6


@dataclass(frozen=True, eq=False)
class Question:
    """Readings of one chunk: (S, n) outputs minus offsets, (n,) or None the rest; angles in rad."""

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


def beyond(q: Question, g: FloatArray) -> FloatArray | None:
    """(S, n) contribution of effects and temperature to the outputs; None if the calibration has none."""
    if all(not s.terms for s in q.calibration.sensors):
        return None
    return np.stack([s.beyond(g, q.warmth) for s in q.calibration.sensors])


def worse_at_most(q: Question) -> float:
    """Maximum factor of an output's variance due to the calibration (eq. 73): at least one."""
    worst, at = 1.0, 0
    for sensor, noise in zip(q.calibration.sensors, q.noise.variance, strict=True):
        k = sensor.coefficients.size
        own = q.calibration.use_covariance[at : at + k, at : at + k]
        worst = max(worst, 1.0 + 2.0 * float(np.linalg.eigvalsh(own)[-1]) / float(noise))
        at += k
    return worst


def f_absurd(above: int, q: Question) -> float:
    """Limit of F for a package at rest, unchanged since its calibration."""
    return f_limit(_LEVEL_ABSURD, above, float(q.calibration.sigma_df.min()))


def absurd_squares(q: Question) -> float:
    """Limit of the remaining weighted squares beyond which a package is not at rest, or has changed."""
    above = max(len(q.y) - (2 if q.roll is None else 1), 1)
    return above * f_absurd(above, q) * worse_at_most(q)
