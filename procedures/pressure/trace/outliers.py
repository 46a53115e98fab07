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
    count, n = problem.outputs.shape
    kept = np.arange(n)
    steps = [resolution(output) for output in problem.outputs]
    found: dict[int, tuple[FloatArray, FloatArray]] = {}
    while len(found) <= FEW * n:
        part = problem.take(kept)
        alone, scale, df, off = (np.empty((count, *of)) for of in ((kept.size,), (), (), (kept.size,)))
        for i, step in enumerate(steps):
            left, share = part.left_within(chosen, i)
            whole = np.sqrt(np.maximum(share, LONE))
            alone[i] = np.where(share > LONE, left / part.sd[i] / whole, 0.0)
            scale[i] = max(robust_sd(alone[i], step / (part.sd[i] * whole), INSIDE), np.finfo(float).tiny)
            df[i], off[i] = float(np.sum(share)), left / np.maximum(share, LONE)
        sd = alone / scale[:, None]
        p = 2.0 * special.stdtr(np.maximum(df, 1.0)[:, None], -np.abs(sd)) * n * count
        worst = np.max(np.abs(sd), axis=0)
        over = np.flatnonzero(np.any(p < BY_CHANCE, axis=0))
        if not over.size:
            break
        for plot in np.unique(part.whole_plot[over]):
            mine = over[part.whole_plot[over] == plot]
            row = int(mine[np.argmax(worst[mine])])
            found[int(kept[row])] = (off[:, row], p[:, row])
        kept = np.setdiff1d(np.arange(n), list(found))
    if not found or len(found) > max(FEW * n, 1.0):
        return Outliers(np.zeros(0, np.int64), *(np.zeros((count, 0)) for _ in range(3)))
    rows = sorted(found)
    off, p = (np.column_stack([found[row][k] for row in rows]) for k in range(2))
    return Outliers(np.array(rows, np.int64), off / (scale[:, None] * problem.sd[:, rows]), off, p)
