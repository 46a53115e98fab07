"""Uncertainty of the variances: many possible pairs, and a straight line fitted for each.

Neither psi nor the size of the variances within is known. Q(psi) is chi squared with m - p degrees of freedom for any
psi, so a value of chi squared is solved for psi; and the variances within are known with `df` degrees of freedom
(generalised inference: Weerahandi, Exact Statistical Methods for Data Analysis, 1995). Without errors within, a mean
over these draws is exactly Student's t on m - p degrees of freedom; with them it is conservative.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy import special

from rig.fitter.arrays import FloatArray
from rig.fitter.history.between_calibrations import Between, Profile
from rig.fitter.history.series import Series

NODES = 128
_GOLDEN = 0.6180339887498949


@dataclass(frozen=True, eq=False)
class Draws:
    """Straight lines under n possible variances.

    Attributes:
        psi: (n,) variance between calibrations.
        inverse: (n, m, m) of the covariance of the values.
        lines: (n, 2) intercept and slope.
        covariance: (n, 2, 2) of them.

    """

    psi: FloatArray
    inverse: FloatArray
    lines: FloatArray
    covariance: FloatArray


def draw(series: Series, between: Between, nodes: int = NODES) -> Draws:
    """Fit a line to a series of at least three calibrations for each of `nodes` draws, which are always the same."""
    factor, target = _variances(nodes, len(series) - 2, series.df)
    psi = Profile.of(series, series.line, between).psi(target, factor)
    v = factor[:, None, None] * np.diag(series.variance) + psi[:, None, None] * between.among(series.years)
    inverse = np.linalg.inv(v)
    weighted = inverse @ series.line
    covariance = np.linalg.inv(series.line.T @ weighted)
    lines = covariance @ (np.swapaxes(weighted, 1, 2) @ series.values)[:, :, None]
    return Draws(psi, np.asarray(inverse), lines[:, :, 0], np.asarray(covariance))


@lru_cache(maxsize=64)
def _variances(nodes: int, df: int, df_within: float) -> tuple[FloatArray, FloatArray]:
    """(n,) factors on the variances within and (n,) values of chi squared, evenly over both distributions."""
    first = (np.arange(nodes) + 0.5) / nodes
    second = np.mod(0.5 + _GOLDEN * np.arange(nodes), 1.0)
    return df_within / special.chdtri(df_within, second), special.chdtri(df, first)
