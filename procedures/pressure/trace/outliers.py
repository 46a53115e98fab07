"""Outliers of whole plots: reported, and left out of search and fit.

They are searched with the effects in the model, on the scale of a quantile of all residuals, which is insensitive to a
few; the worst of a whole plot first, because it affects the others.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import special

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.resolution import resolution, robust_sd
from rig.fitter.trace.limits import limit
from rig.procedures.pressure.trace.problem import Problem
from rig.procedures.pressure.trace.score import beside

BY_CHANCE = limit("outlier", "whole-plot")
"""Probability that a reading of a clean run is named, for normal errors."""
FEW = limit("most outliers", "whole-plot")
"""Maximum share of outliers; more mean noise with long tails, or an effect."""
INSIDE = limit("inner residuals", "whole-plot")
"""Share of residuals for the scale."""
LONE = 0.05
"""A reading with no larger share in its residual has hardly another for comparison."""


@dataclass(frozen=True, eq=False)
class Outliers:
    """Outliers.

    Attributes:
        rows: (k,) rows with an outlier of any transducer.
        sd: (S, k) deviations in standard deviations, in each.
        off_mV: (S, k) the same in mV.
        p: (S, k) probability that any reading of the run has such a deviation.
    """

    rows: IntArray
    sd: FloatArray
    off_mV: FloatArray
    p: FloatArray


def outliers(problem: Problem, chosen: tuple[int, ...]) -> Outliers:
    """The outliers beside the `chosen` candidates, with deviations after removal of the others."""
    count, n = len(problem.sensors), problem.outputs.shape[1]
    kept = np.arange(n)
    steps = np.array([resolution(output) for output in problem.outputs])
    found: dict[int, tuple[FloatArray, FloatArray]] = {}
    while len(found) <= FEW * n:
        part = problem.take(kept)
        stratum = beside(part, "subplot", chosen, ())
        share = np.stack([strata.kept for strata in part.strata])
        whole = np.sqrt(np.maximum(share, LONE))
        alone = np.where(share > LONE, stratum.white.outputs / whole, 0.0)
        rounded = steps[:, None] * np.sqrt(part.weight) / (stratum.sigma[:, None] * whole)
        scale = np.array([robust_sd(one, step, INSIDE) for one, step in zip(alone, rounded, strict=True)])
        sd = alone / np.maximum(scale, np.finfo(float).tiny)[:, None]
        p = 2.0 * special.stdtr(np.maximum(stratum.df, 1.0)[:, None], -np.abs(sd)) * n * count
        worst = np.max(np.abs(sd), axis=0)
        over = np.flatnonzero(np.any(p < BY_CHANCE, axis=0))
        if not over.size:
            break
        # a residual over its share of variance is the deviation of the reading from the prediction by all others
        off = alone * stratum.sigma[:, None] / np.sqrt(part.weight) / whole
        for plot in np.unique(part.whole_plot[over]):
            mine = over[part.whole_plot[over] == plot]
            row = int(mine[np.argmax(worst[mine])])
            found[int(kept[row])] = (off[:, row], p[:, row])
        kept = np.setdiff1d(np.arange(n), list(found))
    if not found or len(found) > max(FEW * n, 1.0):
        return Outliers(np.zeros(0, np.int64), *(np.zeros((count, 0)) for _ in range(3)))
    rows = sorted(found)
    ordinary = (scale * stratum.sigma)[:, None] / np.sqrt(problem.weight[:, rows])
    off, p = (np.column_stack([found[row][k] for row in rows]) for k in range(2))
    return Outliers(np.array(rows, np.int64), off / ordinary, off, p)
