"""Model error that repeats in every replication: intervals cannot cover it; its possible size."""

from __future__ import annotations

import numpy as np

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.linear import LinearFit
from rig.fitter.replication import Replication


def covered(*, replicated: bool) -> str:
    """Text about the coverage of the parameters' intervals."""
    scatter = "the scatter between replications" if replicated else "the scatter of the residuals"
    return (
        f"standard errors and intervals use {scatter}; they do not cover model error, which repeats in every "
        "replication and moves all of them alike"
    )


COVERED_BY_WHOLE_PLOTS = (
    "standard errors and intervals use the scatter of readings within whole plots and of whole plots; they do not "
    "cover model error, which repeats in every whole plot at the same settings"
)
"""Text about the coverage of a whole-plot calibration's intervals."""


def lacks_fit(table: Replication) -> bool:
    """Whether lack of fit is significant (5 %): T_bias, or the test with drift removed if T_bias is insensitive."""
    return bool(table.bias.value > table.bias.limit_95) or (table.blind is not None and table.blind.lacks_fit)


def reach_of_misfit(columns: FloatArray, point: IntArray, sigma_bias: float) -> FloatArray:
    """(L, L) covariance whose roots are possible changes of coefficients by a model error as large as the lack of fit.

    A fit leaves one part of a model error in the residuals, rms `sigma_bias` over the points, and absorbs another part
    without trace. If that part is as large, a combination c of the coefficients changes by sigma_bias (K c'(H'H)^-1
    c)^1/2 at most (Cauchy and Schwarz), H with a row for each of the K points. Twice that is reported: the hidden part
    may be larger.

    Args:
        columns: (n, L) rows of the declared model.
        point: (n,) point of the design, from 0.
        sigma_bias: of the lack of fit, in units of the output.
    """
    first = np.unique(point, return_index=True)[1]
    rows = columns[first]
    return np.asarray((2.0 * sigma_bias) ** 2 * len(rows) * np.linalg.inv(rows.T @ rows))


def reach_beside(fit: LinearFit, sigma_bias: float) -> FloatArray:
    """(L, L) covariance as of `reach_of_misfit`, for a fit with effects: they can absorb model error as well.

    With n readings a model error of that rms has the length sigma_bias n^1/2, for any distribution over points.
    """
    return np.asarray((2.0 * sigma_bias) ** 2 * fit.n * fit.root @ fit.root.T)
