"""Likelihood of residuals for a random walk of the offset, of several widths, and the scatter of readings.

Differences between consecutive observations of one replication have a covariance of three diagonals under both, which
is factored once for every width. The likelihood is restricted: it allows for the part of a walk that the model absorbs,
with own parameters of every replication, at every width.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky_banded, qr
from scipy.linalg.lapack import dtbtrs

from rig.fitter import ties
from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.linear import orthonormal

STEPS = (0.0, 1e-5, 6e-5, 3.6e-4, 2.2e-3, 1.3e-2, 8e-2)
"""Tried mean square steps of a walk between observations, over the variance of the scatter."""
WIDE = (*STEPS, 0.5, 4.0)
"""The same where a walk is seen. Without the largest two, errors of readings that remember the one before by 0.97
looked like steps in 3 of 10 runs, with them in none. A large shape that repeats in every replication would be one, too.
"""
SPREAD = 1.5
"""Inflation of the ratio relative to chi squared for a walk, because its width is unknown: 1.1 to 1.9 by simulation of
walks to 1, 2 and 5 standard deviations over a night of 1,482 readings.
"""


@dataclass(frozen=True, eq=False)
class Width:
    """One width of the walk.

    Attributes:
        factor: (2, m) of the differences' covariance, banded.
        taken: (m, r) orthonormal basis of the model, whitened.
        determinant: half the logarithm of the determinants of both.
    """

    factor: FloatArray
    taken: FloatArray
    determinant: float


@dataclass(frozen=True, eq=False)
class Walks:
    """Likelihoods of the remainder at one level.

    Attributes:
        rows: (n,) rows in the order of running.
        across: (n - 1,) differences across the start of a replication, which are not used.
        widths: one for each mean square step.
        df: degrees of freedom of the level.
    """

    rows: IntArray
    across: NDArray[np.bool_]
    widths: tuple[Width, ...]
    df: float

    def products(self, columns: FloatArray) -> FloatArray:
        """(T, q, q) products of columns (n, q), whitened for each width, beside the model."""
        moves = np.where(self.across[:, None], 0.0, np.diff(columns[self.rows], axis=0))
        out = np.empty((len(self.widths), columns.shape[1], columns.shape[1]))
        for k, width in enumerate(self.widths):
            white = dtbtrs(width.factor, moves, uplo="L")[0]
            share = width.taken.T @ white
            out[k] = white.T @ white - share.T @ share
        return out

    def log_likelihood(self, rss: FloatArray) -> FloatArray:
        """(T, ...) logarithm of the likelihood, up to a constant, of residual sums of squares (T, ...)."""
        determinant = np.array([width.determinant for width in self.widths])
        shape = (-1,) + (1,) * (rss.ndim - 1)
        return np.asarray(-0.5 * self.df * np.log(np.maximum(rss, np.finfo(float).tiny)) - determinant.reshape(shape))


def walks_of(
    rows: IntArray, replicate: IntArray, taken: FloatArray, df: float, steps: Sequence[float] = STEPS
) -> Walks:
    """Factor the covariance for every width.

    Args:
        rows: (n,) in the order of running.
        replicate: (n,) replication of each row.
        taken: (n, k) basis of the model.
        df: degrees of freedom beside it.
        steps: mean square steps, over the variance of the scatter.
    """
    across = np.diff(replicate[rows]) != 0
    below = np.append(np.where(across[:-1] | across[1:], 0.0, -1.0), 0.0)
    moves = orthonormal(np.where(across[:, None], 0.0, np.diff(taken[rows], axis=0)), tolerance=1e-6)
    widths: list[Width] = []
    for step in steps:
        factor = cholesky_banded(np.stack([np.where(across, 1.0, 2.0 + step), below]), lower=True, check_finite=False)
        basis, triangle = qr(dtbtrs(factor, moves, uplo="L")[0], mode="economic", check_finite=False, overwrite_a=True)
        determinant = float(np.sum(np.log(factor[0])) + np.sum(np.log(np.abs(np.diag(triangle)))))
        widths.append(Width(factor, np.asarray(basis, np.float64), determinant))
    return Walks(rows, across, tuple(widths), df)


def likelihood_ratio(
    walks: Walks, outputs: Sequence[FloatArray], columns: Sequence[FloatArray], spread: float = SPREAD
) -> float:
    """Twice the log-likelihood ratio of outputs with and without some columns, with a random walk in both.

    The walk of each sensor has its most likely width, with and without the columns: so the columns get no credit for
    what a walk explains as well. It is about chi squared for scatter and a walk alone.

    Args:
        walks: of the level.
        outputs: (n,) remainder at the level for each sensor concerned.
        columns: (n, q) for each of them.
        spread: divisor of the ratio if a walk is most likely.
    """
    every = walks.products(np.column_stack([part for pair in zip(outputs, columns, strict=True) for part in pair]))
    at, q = np.arange(len(outputs)), columns[0].shape[1]
    squares = every.reshape(-1, at.size, q + 1, at.size, q + 1)[:, at, :, at].swapaxes(0, 1)
    without, gamma = walks.log_likelihood(squares[:, :, 0, 0]), np.zeros(q)
    step = np.zeros(without.shape[1], np.int64)
    for _ in range(3):
        combined = np.concatenate([[1.0], -gamma])
        picked = squares[step, at]
        weight = 1.0 / np.maximum(np.einsum("j,sjk,k->s", combined, picked, combined), np.finfo(float).tiny)
        total = np.einsum("s,sjk->jk", weight, picked)
        gamma = np.linalg.lstsq(total[1:, 1:], total[1:, 0], rcond=1e-9)[0]
        combined = np.concatenate([[1.0], -gamma])
        within = walks.log_likelihood(np.einsum("j,tsjk,k->ts", combined, squares, combined))
        step = ties.highest_of_each(within)
    walking = bool(np.any(ties.highest_of_each(without) > 0))
    return float(2.0 * np.sum(within.max(axis=0) - without.max(axis=0))) / (spread if walking else 1.0)
