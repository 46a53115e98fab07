"""Test of constant scatter of a fit's residuals, as assumed by its intervals."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from rig.fitter import ties
from rig.fitter.arrays import FloatArray
from rig.fitter.quantiles import t_tail

FAMILY = 0.01
"""Probability that any column is named if the scatter is constant."""

FEWEST = 12
"""Minimum number of rows: with fewer, a rank correlation would have to be almost perfect."""


def uneven_scatter(residuals: FloatArray, along: Mapping[str, FloatArray]) -> str:
    """The quantity with the largest change of residual scatter, in words; "" if chance explains it.

    Spearman's rank correlation of absolute residuals with each quantity, at a level divided between them.

    Args:
        residuals: (n,) each divided by the root of one minus its leverage, so that all have one standard deviation.
        along: (n,) values by name: columns of the model, the fitted value.
    """
    if len(residuals) < FEWEST:
        return ""
    varying = {name: values for name, values in along.items() if np.ptp(values) > 0}
    if not varying or not np.ptp(np.abs(residuals)) > 0:
        return ""
    found = {name: rank_correlation(np.abs(residuals), values) for name, values in varying.items()}
    name = ties.least(found, key=lambda each: found[each][1])
    if not found[name][1] * len(found) < FAMILY:
        return ""
    low, high = np.quantile(varying[name], [1 / 3, 2 / 3])
    rms = [float(np.sqrt(np.mean(residuals[rows] ** 2))) for rows in (varying[name] <= low, varying[name] >= high)]
    wide, narrow = ("low", "high") if found[name][0] > 0 else ("high", "low")
    return (
        f"the residuals scatter by {rms[0]:.3g} where {name} is low (up to {low:.4g}) and by {rms[1]:.3g} where it is "
        f"high (from {high:.4g}): standard errors and intervals assume one standard deviation for all rows, so "
        f"intervals are too wide where {name} is {wide} and too narrow where it is {narrow}; see rig trace"
    )


def rank_correlation(x: FloatArray, y: FloatArray) -> tuple[float, float]:
    """Spearman's rank correlation of (n,) and (n,), and its two-tailed probability by Student's t.

    As `scipy.stats.spearmanr`, which takes 0.3 s to import. Equal values have their mean rank.
    """
    r = float(np.corrcoef(mean_ranks(x), mean_ranks(y))[0, 1])
    df = len(x) - 2
    if abs(r) >= 1.0:
        return r, 0.0
    return r, t_tail(r * float(np.sqrt(df / ((1.0 + r) * (1.0 - r)))), df)


def mean_ranks(values: FloatArray) -> FloatArray:
    """(n,) rank of each value, from 1; equal values have the mean of theirs."""
    _, which, counts = np.unique(values, return_inverse=True, return_counts=True)
    return np.asarray((np.cumsum(counts) - 0.5 * (counts - 1.0))[which], np.float64)
