"""Test of constant scatter of a fit's residuals, as assumed by its intervals."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy import stats

from fitter.arrays import FloatArray

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
    found = {name: stats.spearmanr(np.abs(residuals), values) for name, values in varying.items()}
    name = min(found, key=lambda each: float(found[each].pvalue))
    if not float(found[name].pvalue) * len(found) < FAMILY:
        return ""
    low, high = np.quantile(varying[name], [1 / 3, 2 / 3])
    rms = [float(np.sqrt(np.mean(residuals[rows] ** 2))) for rows in (varying[name] <= low, varying[name] >= high)]
    wide, narrow = ("low", "high") if float(found[name].statistic) > 0 else ("high", "low")
    return (
        f"the residuals scatter by {rms[0]:.3g} where {name} is low (up to {low:.4g}) and by {rms[1]:.3g} where it is "
        f"high (from {high:.4g}): standard errors and intervals assume one standard deviation for all rows, so "
        f"intervals are too wide where {name} is {wide} and too narrow where it is {narrow}; see rig trace"
    )
