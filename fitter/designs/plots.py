"""Whole plots of a design, and its points in units of independent errors.

The error of a point is that of its whole plot, of variance eta sigma^2, and its own, of variance sigma^2. Subtracting
the share 1 - (1 + m eta)^(-1/2) of the mean of a whole plot of m points makes errors independent, with variance
sigma^2 (J. R. Magnus, J. Econometrics 19 (1982) 239).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.errors import FitError


def share(size: ArrayLike, eta: float) -> FloatArray:
    """Share of a whole plot's mean that is subtracted; `size` is its number of points."""
    return np.asarray(1.0 - 1.0 / np.sqrt(1.0 + np.asarray(size, np.float64) * eta))


def whitened(rows: FloatArray, whole_plot: IntArray | None, eta: float) -> FloatArray:
    """(n, p) rows of a model matrix whose errors are independent; `whole_plot` (n,) has numbers from 0, or is None."""
    if whole_plot is None or eta == 0.0:
        return rows
    size = np.bincount(whole_plot)
    sums = np.zeros((size.size, rows.shape[1]))
    np.add.at(sums, whole_plot, rows)
    return np.asarray(rows - (share(size, eta) / size)[whole_plot, None] * sums[whole_plot])


def numbered(whole_plot: ArrayLike | None, n: int) -> IntArray | None:
    """(n,) whole plots numbered from 0; None if there are none."""
    if whole_plot is None:
        return None
    given = np.asarray(whole_plot)
    if given.shape != (n,):
        raise FitError(f"{n} points need {n} whole plots, not an array of shape {given.shape}")
    return np.asarray(np.unique(given, return_inverse=True)[1], np.int64)


def checked_eta(eta: float) -> float:
    """The ratio of variances, if it is one.

    Raises:
        FitError: it is negative or not finite.
    """
    if not (np.isfinite(eta) and eta >= 0.0):
        raise FitError(f"eta is the variance between whole plots over that within: zero or positive, not {eta}")
    return float(eta)


def sizes(n: int, whole_plots: int) -> IntArray:
    """(whole_plots,) numbers of points, as equal as possible, the larger ones first."""
    return np.asarray([len(part) for part in np.array_split(np.arange(n), whole_plots)], np.int64)
