"""Sums of squares of replicated points, and the F tests between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.linear import orthonormal
from rig.fitter.quantiles import f_limit, f_tail

NAN = float("nan")
AT_ONCE = 32


@dataclass(frozen=True)
class FTest:
    """A ratio of mean squares, its 95 % limit and the probability of exceeding it by chance.

    NaN throughout where the data leave no degrees of freedom for the test.
    """

    value: float
    df_above: int
    df_below: int

    @property
    def limit_95(self) -> float:
        """95 % limit without an effect."""
        return f_limit(0.95, self.df_above, self.df_below)

    @property
    def p(self) -> float:
        """Probability of a larger value without an effect."""
        return f_tail(self.value, self.df_above, self.df_below) if np.isfinite(self.value) else NAN


def centred(columns: FloatArray, group: IntArray) -> FloatArray:
    """(n, q) `columns` minus their mean over each group; `group` (n,) numbers from 0."""
    size = np.bincount(group)
    out = np.empty(columns.shape, order="F")
    for j in range(columns.shape[1]):
        mean = np.bincount(group, columns[:, j]) / np.maximum(size, 1)
        out[:, j] = columns[:, j] - mean[group]
    return out


def own_parameters(columns: FloatArray, replicate: IntArray) -> FloatArray:
    """(n, n_rep L) the declared model's columns once for each replication, zero outside it; column by column."""
    n, k = columns.shape
    n_rep = int(replicate.max()) + 1
    out = np.zeros((n_rep, k, n))
    out[replicate, :, np.arange(n)] = columns
    return out.reshape(n_rep * k, n).T


def within_points(columns: FloatArray, point: IntArray) -> FloatArray:
    """(n, rank) orthonormal basis of the variation of (n, q) `columns` within points."""
    length = np.sqrt(np.einsum("ij,ij->j", columns, columns))
    return orthonormal(centred(columns, point), length, overwrite=True)


def project_out(columns: FloatArray, basis: FloatArray, *, overwrite: bool = False) -> FloatArray:
    """Part of `columns` (n,) or (n, q) outside an orthonormal basis (n, r); a few columns at a time fit the cache.

    With `overwrite` it takes the place of the columns.
    """
    if columns.ndim == 1:
        return np.asarray(columns - basis @ (basis.T @ columns))
    basis = basis.astype(columns.dtype, copy=False)
    out = columns if overwrite else np.empty(columns.shape, columns.dtype, order="F")
    for first in range(0, columns.shape[1], AT_ONCE):
        some = columns.T[first : first + AT_ONCE]
        np.subtract(some, (some @ basis) @ basis.T, out=out.T[first : first + AT_ONCE])
    return out


def ratio(above: float, df_above: int, below: float, df_below: int) -> FTest:
    """The test of one sum of squares against another."""
    if df_above <= 0 or df_below <= 0 or below <= 0:
        return FTest(NAN, max(df_above, 0), max(df_below, 0))
    return FTest(above / df_above / (below / df_below), df_above, df_below)
