"""Whether a residual follows a shape of all recorded quantities jointly, whatever the shape: the unmodelled smooth.

Two questions of one residual. Polynomials of all quantities together, up to each total degree, take up a smooth shape.
Where a shape is too fine for them, rows whose quantities are alike still err alike: the residual of each row times the
mean of its nearest neighbours' (Moran, Biometrika 37 (1950) 17). Of polynomials p is the larger of two: that of
independent normal errors, and that of the residual with random signs, which keeps the scatter of each row and every row
that stands alone (wild bootstrap: Wu, Ann. Statist. 14 (1986) 1261). Of neighbours it is the latter.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import combinations_with_replacement

import numpy as np
from scipy import special

from rig.fitter import ties
from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.constant_scatter import mean_ranks
from rig.fitter.trace.flexible import LEAST_DF, NOTHING_LEFT

PER_COLUMN, MOST_COLUMNS, MOST_DEGREE = 4, 60, 12
"""Rows for each column of polynomials, at least; most columns, and largest total degree."""
NEIGHBOURS = 4
CLOSE = 1.5
"""Likeness of neighbours, times the root of the number of rows, from which on its chance is worth draws."""
DRAWS, WORK = 1000, 1_200_000
"""Draws of random signs, at most, and their number times rows."""
TAIL = 40
"""Draws from which the tail of a score is continued as an exponential."""
QUESTIONS = 2
SKEW = 0.7
"""Share of the range on one side of the median, from which ranks of a quantity are used in place of its values."""
MOST = 0.9
"""Share of what is seen of a shape, from which a quantity is not needed for it."""
MOST_OF_A_ROW = 0.9
"""Leverage of a row for which its residual is enlarged, at most."""
SEED = 19
SQUARES = 2
_LEAST, _TINY = 1e-290, 1e-12

Steps = Sequence[FloatArray]
"""Bases (n, m), one for each total degree from one on, orthonormal beside the model and those before."""
Some = tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Metric:
    """A residual, and how columns are seen beside it.

    Attributes:
        left: (n,) residual, of independent errors of one variance.
        taken: (n, k) orthonormal basis of the model beside which it is.
        white: columns (n, m) in its unit.
    """

    left: FloatArray
    taken: FloatArray
    white: Callable[[FloatArray], FloatArray]


@dataclass(frozen=True, eq=False)
class Jointly:
    """A shape of several quantities in a residual.

    Attributes:
        p: probability of as much by chance, over both questions.
        of: positions of the quantities that are needed for most of it.
        degree: of the polynomials that take it up; 0 where only neighbours show it.
        share: of the residual's variance.
    """

    p: float
    of: tuple[int, ...]
    degree: int
    share: float


def jointly(metric: Metric, values: FloatArray, limit: float, near: IntArray | None = None) -> Jointly | None:
    """The shape over quantities that a residual follows; None where there is none, or too few rows can tell.

    Draws are made only where a first look, which takes no time, sees more than chance.

    Args:
        metric: the residual.
        values: (n, d) quantities, none of them constant.
        limit: probability by chance below which there is a shape.
        near: (n, m) `nearest` rows by the ranks of the quantities, if they are known, at least `NEIGHBOURS`.
    """
    (n, d), left = values.shape, metric.left
    df = n - metric.taken.shape[1]
    if not d or df < 2 * LEAST_DF or not np.any(left):
        return None
    u, even, every = spread_evenly(values), ranks(values), tuple(range(d))
    near = nearest(even) if near is None else near[:, :NEIGHBOURS]
    steps = _steps(metric, u, every)
    own = float(_evidence(steps, left, df).max(initial=0.0))
    normal, alike = math.exp(-own) * len(steps) if steps else 1.0, float(_alike(near, left[:, None])[0])
    seen, close = QUESTIONS * normal < limit, alike * math.sqrt(n) > CLOSE
    if not (seen or close):
        return None
    signed = _signed(metric)
    p_smooth = max(_p(own, _evidence(steps, signed, df).max(axis=0, initial=0.0)), normal) if seen else 1.0
    p_fine = _p(alike, _alike(near, signed)) if close else 1.0
    p = QUESTIONS * min(p_smooth, p_fine)
    if p >= limit:
        return None
    if p_smooth <= p_fine:
        taken = partial(_taken, metric, u)
        of = _needed(every, lambda some: taken(some)[0])
        share, degree = taken(of)
        return Jointly(p, of, degree, share)

    def fine(some: Some) -> float:
        return float(_alike(nearest(even[:, some]), left[:, None])[0])

    of = _needed(every, fine)
    return Jointly(p, of, 0, float(np.clip(fine(of), 0.0, 1.0)))


def _taken(metric: Metric, u: FloatArray, some: Some) -> tuple[float, int]:
    """Largest share of the residual's variance that polynomials of some quantities take up, and their degree."""
    left, df, best, degree, gain = metric.left, metric.left.size - metric.taken.shape[1], 0.0, 1, 0.0
    below = df
    for k, own in enumerate(_steps(metric, u, some)):
        gain, below = gain + float(np.sum((own.T @ left) ** 2)), below - own.shape[1]
        share = 1.0 - (1.0 - gain / float(left @ left)) * df / below
        if ties.below(best, share):
            best, degree = share, k + 1
    return best, degree


def spread_evenly(values: FloatArray) -> FloatArray:
    """(n, d) quantities in -1 to 1; ranks of those that are crowded at one end, as those over decades are."""
    low, high = values.min(axis=0), values.max(axis=0)
    below = (np.median(values, axis=0) - low) / (high - low)
    plain = 2.0 * (values - low) / (high - low) - 1.0
    return np.asarray(np.where(np.maximum(below, 1.0 - below) > SKEW, ranks(values), plain))


def polynomials(u: FloatArray, most: int) -> list[FloatArray]:
    """(n, m) products of Legendre polynomials of quantities (n, d) in -1 to 1, for each total degree from one on.

    As many degrees as `most` columns allow; of too many quantities for the second degree their squares alone.
    """
    d = u.shape[1]
    powers, count = [], 0
    for degree in range(1, MOST_DEGREE + 1):
        picked = (
            [np.bincount(one, minlength=d) for one in combinations_with_replacement(range(d), degree)]
            if (count + math.comb(d + degree - 1, degree) <= most)
            else []
        )
        last = not picked
        if last and degree == SQUARES and count + d <= most:
            picked = list(SQUARES * np.eye(d, dtype=np.int64))
        if picked:
            powers.append(picked)
            count += len(picked)
        if last:
            break
    single = np.asarray(np.polynomial.legendre.legvander(u, len(powers)), np.float64).transpose(1, 2, 0)
    return [np.column_stack([_product(single, one) for one in picked]) for picked in powers]


def _product(single: FloatArray, orders: IntArray) -> FloatArray:
    """(n,) product of polynomials (d, degrees, n) of such orders (d,); those of order zero are one."""
    used = np.flatnonzero(orders)
    return np.asarray(np.prod(single[used, orders[used]], axis=0))


def _steps(metric: Metric, u: FloatArray, some: Some) -> Steps:
    basis, out = metric.taken, []
    for columns in polynomials(u[:, some], min(MOST_COLUMNS, len(u) // PER_COLUMN)):
        white = metric.white(columns)
        length = np.linalg.norm(white, axis=0)
        for _ in range(2):  # once leaves rounding errors
            white = white - basis @ (basis.T @ white)
        own = _unit(white, length)
        if len(u) - basis.shape[1] - own.shape[1] < LEAST_DF:
            break
        out.append(own)
        basis = np.hstack([basis, own])
    return out


def _unit(columns: FloatArray, length: FloatArray) -> FloatArray:
    """(n, rank) orthonormal basis of columns (n, m) that had these lengths before the model was taken out of them.

    By their products: polynomials of quantities in -1 to 1 are far from dependent, and many rows take a fifth of the
    time of `rig.fitter.linear.orthonormal`.
    """
    scaled = columns / np.where(length > 0.0, length, 1.0)
    values, vectors = np.linalg.eigh(scaled.T @ scaled)
    kept = values > NOTHING_LEFT**2
    return np.asarray(scaled @ (vectors[:, kept] / np.sqrt(values[kept])))


def _evidence(steps: Steps, left: FloatArray, df: int) -> FloatArray:
    """(degrees,) or (degrees, draws) -log p of F of polynomials up to each degree, of residuals (n,) or (n, draws)."""
    total, gain, rank, out = np.sum(left**2, axis=0), 0.0, 0, []
    for own in steps:
        gain, rank = gain + np.sum((own.T @ left) ** 2, axis=0), rank + own.shape[1]
        ratio = gain / max(rank, 1) / np.maximum((total - gain) / (df - rank), _TINY * total)
        out.append(-np.log(np.maximum(special.fdtrc(max(rank, 1), df - rank, ratio), _LEAST)))
    return np.array(out)


def _signed(metric: Metric) -> FloatArray:
    """(n, draws) residuals of the model fitted again to the residual with random signs."""
    n = metric.left.size
    draws = int(np.clip(WORK // n, 10 * TAIL, DRAWS))
    signs = np.random.default_rng(SEED).integers(0, 2, (n, draws)) * 2.0 - 1.0
    leverage = np.sum(metric.taken**2, axis=1)
    signs *= (metric.left / np.sqrt(np.maximum(1.0 - leverage, 1.0 - MOST_OF_A_ROW)))[:, None]
    return np.asarray(signs - metric.taken @ (metric.taken.T @ signs))


def _p(score: float, by_chance: FloatArray) -> float:
    """Probability of such a score by chance, from those of draws; beyond nearly all of them as an exponential."""
    ordered = np.sort(by_chance)
    start = float(ordered[-TAIL - 1])
    if score <= start:
        return (1.0 + int(np.sum(ordered >= score))) / (1.0 + ordered.size)
    mean = max(float(np.mean(ordered[-TAIL:])) - start, _TINY)
    return float(TAIL / ordered.size * np.exp(-(score - start) / mean))


def nearest(values: FloatArray, count: int = NEIGHBOURS) -> IntArray:
    """(n, count) rows whose quantities (n, d), of about the same spread, are nearest to those of each row."""
    from scipy.spatial import cKDTree  # noqa: PLC0415 - 0.1 s, for those who trace

    spread = values + 1e-6 * np.random.default_rng(SEED).standard_normal(values.shape)  # no order among equal ones
    _, found = cKDTree(spread).query(spread, count + 1)
    return np.asarray(found, np.int64)[:, 1:]


def _alike(near: IntArray, left: FloatArray) -> FloatArray:
    """(m,) of residuals (n, m): mean product with their neighbours', over the mean square."""
    means = left[near[:, 0]] / near.shape[1]
    for k in range(1, near.shape[1]):
        means += left[near[:, k]] / near.shape[1]
    return np.asarray(np.sum(left * means, axis=0) / np.maximum(np.sum(left**2, axis=0), _LEAST))


def _needed(every: Some, seen: Callable[[Some], float]) -> Some:
    """Quantities that are left when those are dropped in turn without which `MOST` of it is still seen."""
    least = MOST * seen(every)
    while len(every) > 1:
        without = {k: seen(tuple(one for one in every if one != k)) for k in every}
        spare = list(without)[ties.highest(list(without.values()))]
        if without[spare] < least:
            break
        every = tuple(one for one in every if one != spare)
    return every


def ranks(values: FloatArray) -> FloatArray:
    """(n, d) mean rank of each value in its column, in -1 to 1."""
    every = np.column_stack([mean_ranks(v) for v in values.T])
    return np.asarray(2.0 * (every - 1.0) / max(len(values) - 1, 1) - 1.0)
