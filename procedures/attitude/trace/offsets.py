"""Test of a slope in few numbers, one per replication, that may differ independently and may have a random walk.

Their covariance is (1 + w) I + t K, with K of a random walk, in units of their scatter from readings. All sensors have
the same w and t; or the sensor in question has its own, at a price. The slope is tested by the ratio of likelihoods
with and without it, each with its own most likely w and t (restricted likelihood, with the mean removed). The ratio is
converted to Student's t as for one estimated variance, which would be exact.

Calibrated by simulation of 4, 6 and 12 replications of one and of three sensors: a p below 5e-4 occurs in at most 2e-3
of runs if all sensors' offsets walk or differ, and in 5e-3 if only one sensor's do; with scatter of readings only, in a
tenth of that.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy import special

from fitter.arrays import FloatArray

VARIANCES = np.concatenate([[0.0], 4.0 ** np.arange(-2, 8)])
"""Tried values of w and t."""
OWN = 2.0
"""Price, in the logarithm of the likelihood, of a sensor's own variances."""
SPREAD = 1.15
"""Inflation of the ratio if a walk is the most likely."""
AT_ONCE = 32


def slopes(
    x: FloatArray, v: FloatArray, tested: NDArray[np.bool_], others: NDArray[np.bool_], walk: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """(Q,) probabilities of such a slope by chance, and (Q,) signs of the slopes.

    Args:
        x: (S, n, Q) variables of Q slopes, in S sensors.
        v: (S, n, Q) the numbers.
        tested: (S, Q) sensors with the common slope in question.
        others: (S, Q) sensors with their own slopes, used only for the variation of replications.
        walk: (S, Q) minimum t, if known from within replications.
    """
    p, sign = np.ones(x.shape[2]), np.zeros(x.shape[2])
    for first in range(0, x.shape[2], AT_ONCE):
        at = slice(first, first + AT_ONCE)
        p[at], sign[at] = _slopes(x[..., at], v[..., at], tested[:, at], others[:, at], walk[:, at])
    return p, sign


def _slopes(
    x: FloatArray, v: FloatArray, tested: NDArray[np.bool_], others: NDArray[np.bool_], walk: FloatArray
) -> tuple[FloatArray, FloatArray]:
    w, t = np.divmod(np.arange(VARIANCES.size**2)[:, None, None], VARIANCES.size)
    at = w * VARIANCES.size + np.maximum(t, np.searchsorted(0.5 * VARIANCES[1:], walk))
    root, determinant = (of[at] for of in _roots(x.shape[1]))
    wx, wv = (np.einsum("tsqij,sjq->tsqi", root, one, optimize=True) for one in (x, v))
    vv, xv, xx = (np.sum(a * b, axis=3) for a, b in ((wv, wv), (wx, wv), (wx, wx)))
    xx = np.maximum(xx, np.finfo(float).tiny)
    own = np.where(others, vv - xv**2 / xx + np.log(xx) + determinant, 0.0)
    rest = -0.5 * own.sum(axis=1)
    without = -0.5 * np.sum(np.where(tested, vv + determinant, 0.0), axis=1)
    common = np.sum(np.where(tested, xv, 0.0), axis=1)
    length2 = np.maximum(np.sum(np.where(tested, xx, 0.0), axis=1), np.finfo(float).tiny)
    ratio = 2.0 * (_likeliest(without + 0.5 * common**2 / length2, rest) - _likeliest(without, rest))
    walking = np.argmax(without + rest, axis=0) % VARIANCES.size > 0
    ratio = np.maximum(ratio, 0.0) / np.where(walking, SPREAD, 1.0)
    df = (tested.sum(axis=0) + others.sum(axis=0)) * (x.shape[1] - 1) - 1 - others.sum(axis=0)
    df = np.maximum(df, 1)
    t = np.sqrt(df * np.expm1(np.minimum(ratio / df, 50.0)))
    return np.where(tested.any(axis=0), 2.0 * special.stdtr(df, -t), 1.0), np.sign(common[0])


def _likeliest(tested: FloatArray, rest: FloatArray) -> FloatArray:
    """(Q,) logarithm of the likelihood with the best of (T, Q) variances, common or not."""
    apart = np.max(tested, axis=0) + np.max(rest, axis=0) - OWN
    return np.asarray(np.maximum(np.max(tested + rest, axis=0), apart))


@cache
def _roots(n: int) -> tuple[FloatArray, FloatArray]:
    """(T, n - 1, n) transformations that whiten n numbers and remove their mean, and (T,) logarithms of the
    determinants.
    """
    contrasts = np.linalg.qr(np.column_stack([np.ones(n), np.eye(n)[:, 1:]]))[0][:, 1:].T
    ahead = np.arange(1.0, n + 1)
    walk = contrasts @ (np.minimum.outer(ahead, ahead) - np.eye(n) / 6) @ contrasts.T
    both = np.stack([(1.0 + w) * np.eye(n - 1) + t * walk for w in VARIANCES for t in VARIANCES])
    return np.linalg.inv(np.linalg.cholesky(both)) @ contrasts, np.linalg.slogdet(both)[1]
