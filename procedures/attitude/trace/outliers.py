"""Readings that stand out: pointed at, and left out of the search, so that they neither hide nor make effects.

They are looked for beside what is in the model. A reading is compared with the median of its point over replications,
which one bad reading does not move, on the scale of a quantile of all deviations that the few do not move either.
"""

from __future__ import annotations

import numpy as np
from scipy import special

from fitter.arrays import FloatArray, IntArray
from fitter.resolution import resolution, robust_sd
from procedures.attitude.data import AttitudeData

BY_CHANCE = 0.001
"""Probability that one of all readings of a clean run is pointed at, were deviations normal; from a median of six they
are a little more, and one run of a hundred has one."""
FEW = 0.005
"""Of the readings at most; more are no outliers but noise with long tails, or an effect."""
INSIDE = 0.95
"""Share of deviations that the scale is taken from. The middle ones say little of it: of few readings at a point the
median is one of them."""
REPLICATIONS = 3
"""Without as many a point has no median to compare with, and readings are compared with the model alone."""


def outliers(data: AttitudeData, residual: FloatArray) -> tuple[IntArray, FloatArray]:
    """Which readings stand out, and by how much.

    Args:
        data: the run.
        residual: (S, n) of every sensor, V.

    Returns:
        (k,) rows in which a sensor does, and (S, n) deviations in standard deviations.

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
