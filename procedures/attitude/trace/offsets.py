"""Test of a slope in few numbers, one per replication, that may differ independently and may have a random walk.

Their covariance is (1 + w) I + t K, with K of a random walk, in units of their scatter from readings. All sensors have
the same w and t; or the sensor in question has its own, at a price. The slope is tested by the ratio of likelihoods
with and without it, each with its own most likely w and t (restricted likelihood, with the mean removed). The ratio is
converted to Student's t as for one estimated variance, which would be exact.

What is known beside these numbers counts too: a walk inside the replications makes it likelier between them. And that
one sensor wanders alone is less likely the quieter all others are.

Calibrated by simulation of 4, 6 and 12 replications of one and of three sensors: a p below 5e-4 occurs in at most 2e-3
of runs if all sensors' offsets walk or differ, and in 1e-2 if only one sensor's do; with scatter of readings only, in a
tenth of that.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy import special

from rig.fitter.arrays import FloatArray

VARIANCES = np.concatenate([[0.0], 4.0 ** np.arange(-2, 8)])
"""Tried values of w and t."""
OWN = 2.0
"""Price, in the logarithm of the likelihood, of a sensor's own variances if the others wander too."""
ALONE = 3.0
"""The same if nothing else wanders. Between both, the evidence that something does is subtracted, beyond `CHANCE`."""
CHANCE = 1.0
"""Logarithm of the likelihood that quiet numbers gain by the most likely variances, about."""
SPREAD = 1.15
"""Inflation of the ratio if a walk is the most likely."""
AT_ONCE = 256


def slopes(
    x: FloatArray,
    v: FloatArray,
    tested: NDArray[np.bool_],
    others: NDArray[np.bool_],
    walk: FloatArray,
    within: FloatArray | None = None,
    wanders: FloatArray | None = None,
) -> tuple[FloatArray, FloatArray]:
    """(Q,) probabilities of such a slope by chance, and (Q,) signs of the slopes.

    Args:
        x: (S, n, Q) variables of Q slopes, in S sensors.
        v: (S, n, Q) the numbers.
        tested: (S, Q) sensors with the common slope in question.
        others: (S, Q) sensors with their own slopes, used only for the variation of replications.
        walk: (S, Q) minimum t, if known from within replications.
        within: (T, S, Q) logarithm of the likelihood of each t from within replications, over that of none.
        wanders: (Q,) evidence from other numbers that the tested sensors wander, in the logarithm of the likelihood.
    """
    p, sign, count = np.ones(x.shape[2]), np.zeros(x.shape[2]), x.shape[2]
    within = np.zeros((VARIANCES.size, 1, count)) if within is None else within
    wanders = np.zeros(count) if wanders is None else wanders
    for first in range(0, count, AT_ONCE):
        at = slice(first, first + AT_ONCE)
        numbers = x[..., at], v[..., at], tested[:, at], others[:, at]
        p[at], sign[at] = _slopes(*numbers, walk[:, at], within[..., at], wanders[at])
    return p, sign


def _slopes(
    x: FloatArray,
    v: FloatArray,
    tested: NDArray[np.bool_],
    others: NDArray[np.bool_],
    walk: FloatArray,
    within: FloatArray,
    wanders: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    n = x.shape[1]
    w, t = np.divmod(np.arange(VARIANCES.size**2)[:, None, None], VARIANCES.size)
    least = np.maximum(t, np.searchsorted(0.5 * VARIANCES[1:], walk))
    at = w * VARIANCES.size + least
    turned, weight, determinant = _spectrum(n)
    wx, wv = turned @ x, turned @ v
    squares = (np.einsum("tn,snq->tsq", weight, one) for one in (wv * wv, wx * wv, wx * wx))
    vv, xv, xx = (np.take_along_axis(one, at, axis=0) for one in squares)
    xx = np.maximum(xx, np.finfo(float).tiny)
    unlikely = determinant[at] - 2.0 * np.take_along_axis(np.broadcast_to(within, (len(within), *walk.shape)), least, 0)
    own = np.where(others, vv - xv**2 / xx + np.log(xx) + unlikely, 0.0)
    rest = -0.5 * own.sum(axis=1)
    without = -0.5 * np.sum(np.where(tested, vv + unlikely, 0.0), axis=1)
    common = np.sum(np.where(tested, xv, 0.0), axis=1)
    length2 = np.maximum(np.sum(np.where(tested, xx, 0.0), axis=1), np.finfo(float).tiny)
    price = np.clip(ALONE - _beyond_chance(rest) - wanders, OWN, ALONE)
    ratio = 2.0 * (_likeliest(without + 0.5 * common**2 / length2, rest, price) - _likeliest(without, rest, price))
    walking = np.argmax(without + rest, axis=0) % VARIANCES.size > 0
    ratio = np.maximum(ratio, 0.0) / np.where(walking, SPREAD, 1.0)
    df = (tested.sum(axis=0) + others.sum(axis=0)) * (n - 1) - 1 - others.sum(axis=0)
    df = np.maximum(df, 1)
    student = np.sqrt(df * np.expm1(np.minimum(ratio / df, 50.0)))
    return np.where(tested.any(axis=0), 2.0 * special.stdtr(df, -student), 1.0), np.sign(common[0])


def wandering(v: FloatArray) -> FloatArray:
    """(S,) evidence that (S, n) numbers differ or walk beyond their scatter: logarithm of the ratio of likelihoods."""
    turned, weight, determinant = _spectrum(v.shape[1])
    likelihood = -0.5 * (weight @ (turned @ v.T) ** 2 + determinant[:, None])
    return _beyond_chance(likelihood)


def _beyond_chance(likelihood: FloatArray) -> FloatArray:
    """(Q,) what the best of (T, Q) logarithms of the likelihood has beyond the one without variances, and chance."""
    return np.asarray(np.maximum(np.max(likelihood, axis=0) - likelihood[0] - CHANCE, 0.0))


def _likeliest(tested: FloatArray, rest: FloatArray, price: FloatArray) -> FloatArray:
    """(Q,) logarithm of the likelihood with the best of (T, Q) variances, common or not."""
    apart = np.max(tested, axis=0) + np.max(rest, axis=0) - price
    return np.asarray(np.maximum(np.max(tested + rest, axis=0), apart))


@cache
def _spectrum(n: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(n - 1, n) transformation that removes the mean of n numbers and makes them independent for every w and t, (T,
    n - 1) weights of their squares, and (T,) logarithms of the determinants of the covariances.
    """
    contrasts = np.linalg.qr(np.column_stack([np.ones(n), np.eye(n)[:, 1:]]))[0][:, 1:].T
    ahead = np.arange(1.0, n + 1)
    walk = contrasts @ (np.minimum.outer(ahead, ahead) - np.eye(n) / 6) @ contrasts.T
    values, vectors = np.linalg.eigh(walk)
    variance = np.array([1.0 + w + t * values for w in VARIANCES for t in VARIANCES])
    return vectors.T @ contrasts, 1.0 / variance, np.sum(np.log(variance), axis=1)
