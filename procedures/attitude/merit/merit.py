"""Variance function of the calibrated output, eq. (52), and Box's figure of merit, eqs. (53) to (55).

Both are the same for x, y and z sensors in any mounting (Theorems I to III), since they are functions of h = [1, sin a,
cos a sin R, cos a cos R] alone.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from rig.fitter import LinearFit
from rig.fitter.arrays import FloatArray
from rig.procedures.attitude.merit.design_points import DesignPoints, Usage
from rig.procedures.attitude.model import attitude_columns, fit_columns

_STEP_DEG = 2.0
_FEWEST = 9
_ZOOMS = 5


def variance(design: DesignPoints, pitch_deg: ArrayLike, roll_deg: ArrayLike = 0.0) -> FloatArray:
    """Variance of the calibrated output over that of one observation, h'(H'H)^-1 h, eq. (52), all replications used.

    Args:
        design: calibration points.
        pitch_deg: pitch of use; broadcast with `roll_deg` to the shape of the result.
        roll_deg: not used by a sensor calibrated without roll.

    Raises:
        rig.fitter.linear.RankError: the design does not determine the model.
    """
    return _variance(_solved(design), design, pitch_deg, roll_deg)


def mean_variance(design: DesignPoints, usage: Usage) -> float:
    """Mean of `variance` over the test area, uniform in pitch and in roll; exact (appendix E).

    Raises:
        rig.fitter.linear.RankError: the design does not determine the model.

    """
    root = _solved(design).root
    return float(np.sum(root * (_moments(usage, roll=design.roll) @ root))) / design.replications


def figure_of_merit(design: DesignPoints, usage: Usage) -> float:
    """V^(1/2) of eq. (53), the mean normalised standard deviation of Table 1.

    The root of `mean_variance` times the number of observations: a figure independent of the size of the design.
    Smaller is better; 1 would be the mean of all observations, 2 is sqrt(4 parameters).

    Raises:
        rig.fitter.linear.RankError: the design does not determine the model.
    """
    return float(np.sqrt(design.observations * mean_variance(design, usage)))


def worst_variance(design: DesignPoints, usage: Usage) -> tuple[float, float, float]:
    """Largest `variance` in the test area and its pitch and roll (deg); to 1e-6 of its value.

    Raises:
        rig.fitter.linear.RankError: the design does not determine the model.
    """
    fit = _solved(design)
    low, high = np.array([usage.pitch_deg, usage.roll_deg if design.roll else (0.0, 0.0)]).T
    found = (0.0, 0.0, 0.0)
    lowest, highest = low, high
    for _ in range(_ZOOMS):
        count = [max(_FEWEST, int(np.ceil(width / _STEP_DEG)) + 1) if width else 1 for width in high - low]
        pitch, roll = np.meshgrid(*(np.linspace(*span) for span in zip(low, high, count, strict=True)), indexing="ij")
        values = _variance(fit, design, pitch, roll)
        at = np.unravel_index(int(np.argmax(np.round(values / values.max(), 9))), values.shape)  # ties: the first
        if values[at] > found[0] * (1.0 + 1e-9):
            found = (float(values[at]), float(pitch[at]), float(roll[at]))
        step = np.array([w / (c - 1) if c > 1 else 0.0 for w, c in zip(high - low, count, strict=True)])
        centre = np.array(found[1:])
        low, high = np.maximum(lowest, centre - step), np.minimum(highest, centre + step)
    return found


def _solved(design: DesignPoints) -> LinearFit:
    return fit_columns(design.columns(), np.zeros(design.points))


def _variance(fit: LinearFit, design: DesignPoints, pitch_deg: ArrayLike, roll_deg: ArrayLike) -> FloatArray:
    pitch, roll = np.broadcast_arrays(np.asarray(pitch_deg, np.float64), np.asarray(roll_deg, np.float64))
    columns = attitude_columns(pitch.ravel(), roll.ravel(), roll=design.roll)
    return fit.variance_function(columns).reshape(pitch.shape) / design.replications


def _moments(usage: Usage, *, roll: bool) -> FloatArray:
    """(L, L) mean of h h' over the test area: the matrix of eq. (227) over I_bb."""
    s, c, ss, sc, cc = _means(usage.pitch_deg)
    if not roll:
        return np.array([[1.0, s, c], [s, ss, sc], [c, sc, cc]])
    sr, cr, ssr, scr, ccr = _means(usage.roll_deg)
    return np.array(
        [
            [1.0, s, c * sr, c * cr],
            [s, ss, sc * sr, sc * cr],
            [c * sr, sc * sr, cc * ssr, cc * scr],
            [c * cr, sc * cr, cc * scr, cc * ccr],
        ]
    )


def _means(span_deg: tuple[float, float]) -> tuple[float, float, float, float, float]:
    """Means of sin, cos, sin^2, sin cos and cos^2 over a range, or at one angle if the range is a point."""
    middle, half = np.radians((span_deg[0] + span_deg[1]) / 2.0), np.radians((span_deg[1] - span_deg[0]) / 2.0)
    once, twice = np.sinc(half / np.pi), np.sinc(2.0 * half / np.pi)
    s, c = once * np.sin(middle), once * np.cos(middle)
    s2, c2 = twice * np.sin(2.0 * middle), twice * np.cos(2.0 * middle)
    return float(s), float(c), float((1.0 - c2) / 2.0), float(s2 / 2.0), float((1.0 + c2) / 2.0)
