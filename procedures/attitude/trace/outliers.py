"""Outliers: reported, and left out of the search, so that they neither mask nor create effects.

They are searched with the effects in the model. A reading is compared with the median of its point over replications,
which is insensitive to one bad reading, on the scale of a quantile of all deviations, which is insensitive to a few.
"""

from __future__ import annotations

import numpy as np
from scipy import special

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.resolution import resolution, robust_sd
from rig.fitter.trace.limits import limit
from rig.procedures.attitude.data import AttitudeData

BY_CHANCE = 1e-3
"""Probability that a reading of a clean run is named, for normal deviations; from a median of six they are a little
larger, and one run of a hundred has one.
"""
FEW = limit("most outliers", "pitch-roll")
"""Maximum share of outliers; more mean noise with long tails, or an effect."""
INSIDE = limit("inner residuals", "pitch-roll")
"""Share of deviations for the scale. The middle ones have little information: with few readings at a point the median
is one of them.
"""
REPLICATIONS = 3
"""Minimum number of readings for a point's median; with fewer, readings are compared with the model alone."""


def outliers(data: AttitudeData, residual: FloatArray) -> tuple[IntArray, FloatArray]:
    """Outliers, and their deviations.

    Args:
        data: the run.
        residual: (S, n) of every sensor, V.

    Returns:
        (k,) rows with an outlier of a sensor, and (S, n) deviations in standard deviations.
    """
    steps = [resolution(output) for output in data.outputs.values()]
    sd = np.stack([_deviations(data, one, step) for one, step in zip(residual, steps, strict=True)])
    limit = float(special.ndtri(1.0 - 0.5 * BY_CHANCE / sd.size))
    rows = np.flatnonzero(np.any(np.abs(sd) > limit, axis=0))
    return (rows if rows.size <= max(FEW * len(data), 1.0) else rows[:0]), sd


def _deviations(data: AttitudeData, residual: FloatArray, step: float) -> FloatArray:
    """(n,) deviations of one sensor from its points' medians, over their scale."""
    e = residual.copy()
    if data.replicates.size >= REPLICATIONS:
        ahead = np.lexsort((e, data.point))
        visits = np.bincount(data.point)
        first = np.concatenate([[0], np.cumsum(visits)[:-1]])
        middle = 0.5 * (e[ahead][first + (visits - 1) // 2] + e[ahead][first + visits // 2])
        e -= middle[data.point]
    scale = robust_sd(e, step, INSIDE)
    return np.asarray(e / scale) if scale > 0 else np.zeros_like(e)
