"""Test of lack of fit of a transducer's model within whole plots, against readings repeated there at a pressure."""

from __future__ import annotations

from typing import Any

import numpy as np

from rig.fitter.linear import orthonormal
from rig.fitter.sums_of_squares import NAN, FTest
from rig.procedures.pressure.fit.problem import Problem


def lack_of_fit(problem: Problem) -> FTest:
    """F of the residual between repeated readings over their own scatter; rows are weighted by their error. Every whole
    plot has its own offset in addition to the model, so errors of whole plots have no influence. NaN if no pressure
    repeats within a whole plot.
    """
    data, plots, levels = problem.data, problem.data.whole_plot_index, problem.data.pressure_levels[1]
    weight = 1.0 / problem.errors.subplot_sd(data.pressure_psia)
    model = np.column_stack([np.eye(int(plots.max()) + 1)[plots], problem.columns]) * weight[:, None]
    basis = orthonormal(model)
    left = weight * data.outputs[problem.output]
    for _ in range(2):
        left = left - basis @ (basis.T @ left)
    cell = np.unique(plots * (1 + levels.max()) + levels, return_inverse=True)[1].reshape(-1)
    mean = np.bincount(cell, left * weight) / np.bincount(cell, weight**2)
    pure = float(np.sum((left - mean[cell] * weight) ** 2))
    below = len(left) - int(cell.max()) - 1
    above = len(left) - basis.shape[1] - below
    if above <= 0 or below <= 0 or not pure > 0.0:
        return FTest(NAN, max(above, 0), max(below, 0))
    return FTest((float(left @ left) - pure) / above / (pure / below), above, below)


def significant(test: FTest) -> bool:
    """Whether there is lack of fit at 5 %, as in attitude fits."""
    return bool(test.value > test.limit_95)


def to_dict(test: FTest) -> dict[str, Any]:
    """JSON values; None without repeats."""
    known = bool(np.isfinite(test.value))
    return {
        "F": test.value if known else None,
        "df_above": test.df_above,
        "df_below": test.df_below,
        "limit_95": test.limit_95 if known else None,
        "p": test.p if known else None,
        "significant": significant(test) if known else None,
    }


def in_words(test: FTest) -> str:
    """Sentence about lack of fit; "" without lack of fit or repeats."""
    if not significant(test):
        return ""
    return (
        f"lack of fit is significant within whole plots (F = {test.value:.3g} on {test.df_above} and {test.df_below} "
        f"degrees of freedom, 95 % limit {test.limit_95:.3g}): the model is off by more than repeated readings "
        f"scatter, and intervals do not cover that; see rig trace"
    )
