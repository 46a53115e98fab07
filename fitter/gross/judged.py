"""Rows outside a robust fit, judged: how many are off, and which."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import special
from scipy.linalg import cho_factor, cho_solve, solve_triangular
from scipy.linalg.lapack import dpocon, dpstrf

from rig.fitter import ties
from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.gross.rows import Rows

LONE = 1e-6
"""A row with no larger share in its residual cannot be checked."""
TOGETHER = 1e-10
"""Rows whose block of the residual maker has a smaller reciprocal condition cannot be left out together."""
GIANT = 1e4
"""Standard deviations beyond which a row's deviation is taken out of sums of squares. It is named in any case."""
ONE = 0.8
"""Share of the level for tables with one gross error; the rest is for those with more."""
ALIKE, SHARE = 0.5, 0.25
"""Logarithm by which sets of one row more are fewer than their number, since sets with most rows in common are no
separate chances; maximum share of rows in a set. Measured, with the search of clean tables:
docs/explanation/fits.md.
"""
GOOD = 0.01
"""Probability of a reading's deviation from which it is taken back before the others are judged."""


@dataclass(frozen=True, eq=False)
class Found:
    """Rows that deviate.

    Attributes:
        out: (m,) indices, the farthest first.
        distance: (m,) from the fit without them, in standard deviations.
        off: (m,) the same in units of the weighted response.
        p: probability that a clean table has such a set of rows.
        sigma: standard deviation of a row by the fit without them, weighted.
        doubtful: number of rows whose deviations together are no chance, beyond those that are off by themselves.
    """

    out: IntArray
    distance: FloatArray
    off: FloatArray
    p: float
    sigma: float
    doubtful: int = 0


@dataclass(frozen=True, eq=False)
class _Step:
    """A fit without some rows.

    Attributes:
        out: (m,) these rows.
        off: (m,) their deviations from it, without what was taken out of the response before.
        distance: (m,) the same in standard deviations, with that.
        rss: residual sum of squares.
        sigma: standard deviation.
    """

    out: IntArray
    off: FloatArray
    distance: FloatArray
    rss: float
    sigma: float


def judged(rows: Rows, out: IntArray, floor: float, level: float, responses: int = 1) -> Found:
    """The deviating rows among those outside a robust fit.

    Args:
        rows: all rows.
        out: (k,) those outside.
        floor: minimum standard deviation.
        level: probability that a clean table has a row named.
        responses: of the table.
    """
    n = len(rows.y)
    rows, taken = _without_giants(rows, out, floor)
    giants, most = int(np.count_nonzero(taken)), int(SHARE * n)
    steps = _taken_back(rows, out, taken, floor)
    squares = np.array([step.rss for step in steps])
    evidence = _evidence(squares, giants, n, rows.df, floor)
    count = giants + ties.lowest(evidence[giants : max(giants, most) + 1])
    p = float(np.exp(min(evidence[count], 0.0))) * responses
    found = _each_by_itself(steps, taken, n, rows.df, level, responses)
    final = steps[found.out.size]
    if giants or p < level:
        count = _deviating(steps, count, giants, rows.df)
        each = _tails(steps[count], rows.df) * (n - count + 1) * responses
        named = steps[count].out[each < level]
        if named.size > found.out.size:
            final = _step(rows, named, _inverse(rows, named), taken, floor)
            found = _found(final, taken, min(p, float(each.min())))
    squares[found.out.size] = final.rss
    evidence = _evidence(squares, found.out.size, n, rows.df, floor)[found.out.size : max(found.out.size, most) + 1]
    further = ties.lowest(evidence)
    if evidence[further] + np.log(responses) < np.log(level):
        doubtful = _deviating(steps, found.out.size + further, found.out.size, rows.df) - found.out.size
        return replace(found, doubtful=doubtful)
    return found


def _deviating(steps: list[_Step], count: int, least: int, df: int) -> int:
    """The number of rows outside, without the nearest that a clean table would have, too."""
    while count > least and _tails(steps[count], df).max() > GOOD:
        count -= 1
    return count


def _each_by_itself(steps: list[_Step], taken: FloatArray, n: int, df: int, level: float, responses: int) -> Found:
    """The most rows of which the nearest is too far by itself: of a few rows that says more than a test of the set."""
    for count in range(len(steps) - 1, 0, -1):
        p = float(_tails(steps[count], df).max()) * (n - count + 1) * responses
        if p < level:
            return _found(steps[count], taken, p)
    return _found(steps[0], taken, 1.0)


def _tails(step: _Step, df: int) -> FloatArray:
    """(m,) probabilities of such deviations of single rows."""
    return np.asarray(2.0 * special.stdtr(df - step.out.size, -np.abs(step.distance)))


def _found(step: _Step, taken: FloatArray, p: float) -> Found:
    ahead = ties.descending(np.abs(step.distance))
    out = step.out[ahead]
    return Found(out, step.distance[ahead], step.off[ahead] + taken[out], p, step.sigma)


def _taken_back(rows: Rows, out: IntArray, taken: FloatArray, floor: float) -> list[_Step]:
    """Fits without the rows `out`, of which the nearest is taken back each time; by the number of rows left out."""
    inverse = _inverse(rows, out)
    steps = []
    while True:
        step = _step(rows, out, inverse, taken, floor)
        steps.append(step)
        if not out.size:
            return steps[::-1]
        back = ties.lowest(np.abs(step.distance))
        # adding a row: the inverse of the smaller block, by the matrix inversion lemma
        row = inverse[back]
        inverse = np.delete(np.delete(inverse - np.outer(row, row) / row[back], back, 0), back, 1)
        out = np.delete(out, back)


def _inverse(rows: Rows, out: IntArray) -> FloatArray:
    return np.asarray(np.linalg.inv(rows.block(out))) if out.size else np.zeros((0, 0))


def _step(rows: Rows, out: IntArray, inverse: FloatArray, taken: FloatArray, floor: float) -> _Step:
    e = rows.residual[out]
    off = inverse @ e
    rss = max(float(rows.residual @ rows.residual) - float(e @ off), 0.0)
    sigma = max(float(np.sqrt(rss / (rows.df - out.size))), floor)
    return _Step(out, off, (off + taken[out]) / (sigma * np.sqrt(np.diag(inverse))), rss, sigma)


def _evidence(squares: FloatArray, giants: int, n: int, df: int, floor: float) -> FloatArray:
    """(k + 1,) logarithms of the probability that the best set of so many rows lowers the sum of squares as much.

    The F test of a set that was chosen beforehand, times the number of sets of its size (Bonferroni). Rows judged
    together are not hidden by the weakest of them. That the sets of all sizes are tried is paid by shares of the level.
    """
    count = np.arange(len(squares)) - giants
    more, left = np.maximum(count, 1), df - giants - count
    squares = np.maximum(squares, floor**2 * left)
    ratio = np.minimum(squares / squares[giants], 1.0) if squares[giants] > 0.0 else np.ones(len(squares))
    return np.where(count <= 0, 0.0, _chance(n - giants, more, left, ratio))


def _chance(n: int, more: IntArray | int, left: IntArray | int, ratio: FloatArray | float) -> FloatArray:
    """Logarithm of the probability that any `more` of n rows lower a sum of squares to this ratio, with `left` degrees
    of freedom then.
    """
    more = np.asarray(more)
    sets = special.gammaln(n + 1) - special.gammaln(more + 1) - special.gammaln(n - more + 1)
    share = np.where(more == 1, ONE, (1.0 - ONE) / np.maximum(more * (more - 1.0), 1.0))
    by_one = _log_beta(np.asarray(0.5 * np.asarray(left)), np.asarray(0.5 * more), np.asarray(ratio))
    return np.asarray(sets - ALIKE * (more - 1) + by_one - np.log(share))


def _log_beta(a: FloatArray, b: FloatArray, x: FloatArray) -> FloatArray:
    """Logarithms of the regularised incomplete beta function; its leading term where that is too small for a double."""
    with np.errstate(divide="ignore"):
        leading = a * np.log(x) + b * np.log1p(-np.minimum(x, 0.5)) - np.log(a) - special.betaln(a, b)
        value = special.betainc(a, b, x)
        return np.asarray(np.where(value > 1e-290, np.log(value), leading))


def _without_giants(rows: Rows, out: IntArray, floor: float) -> tuple[Rows, FloatArray]:
    """The rows, of those far off a fit without `out` only what is not their deviation; and (n,) these deviations.

    What a row that is left out reads does not change the fit of the others, but in sums of squares of all rows
    the others are lost beside it by rounding.
    """
    taken = np.zeros(len(rows.y))
    if not out.size:
        return rows, taken
    _, left, rss = without(rows, out)
    far = out[np.abs(left[out]) > GIANT * max(np.sqrt(rss / max(rows.df - out.size, 1)), floor)]
    taken[far] = left[far]
    return (rows.of(rows.y - taken) if far.size else rows), taken


def without(rows: Rows, out: IntArray) -> tuple[IntArray, FloatArray, float]:
    """Rows left out of the fit: `out`, but for those that the fit of the others needs; (n,) residuals of all rows, and
    their sum of squares.
    """
    e = rows.residual
    if not out.size:
        return out, e, float(e @ e)
    block, least = rows.block(out), LONE
    if not _determined(block):
        out = out[_free(block)]
        block = rows.block(out)
    while out.size and not _determined(block):
        out = out[_largest(block, least)]
        block, least = rows.block(out), 100.0 * least
    if not out.size:
        return out, e, float(e @ e)
    off = cho_solve(cho_factor(block, lower=True), e[out])
    left = e - rows.spread(out, off)
    # Summed, not the difference of two sums: beside a row at 1e9 standard deviations nothing would remain of it.
    left[out] = 0.0
    rss = float(left @ left)
    left[out] = off
    return out, left, rss


def _determined(block: FloatArray) -> bool:
    """Whether each row keeps some of its share in its residual when those before it are left out, by their (k, k)
    rows and columns of the residual maker; and all of them together do.
    """
    try:
        factor = np.linalg.cholesky(block)
    except np.linalg.LinAlgError:
        return False
    if np.min(np.diag(factor)) ** 2 <= LONE:
        return False
    # Many rows may each keep a share, and together none: settings from 0.005 to 1000 without those above 0.01.
    reciprocal, _ = dpocon(factor, np.linalg.norm(block, 1), uplo="L")
    return bool(reciprocal > TOGETHER)


def _free(block: FloatArray) -> IntArray:
    """Places (m,) of rows that can be left out one after another, by (k, k) rows and columns of the residual maker.

    A pivot of the Cholesky factor is the share of a row in its own residual when those before it are left out.
    """
    free: list[int] = []
    factor = np.zeros_like(block)
    for i in range(len(block)):
        m = len(free)
        row = solve_triangular(factor[:m, :m], block[free, i], lower=True, check_finite=False) if m else np.zeros(0)
        pivot = float(block[i, i] - row @ row)
        if pivot > LONE:
            factor[m, :m], factor[m, m] = row, np.sqrt(pivot)
            free.append(i)
    return np.array(free, np.int64)


def _largest(block: FloatArray, least: float) -> IntArray:
    """The same with the largest pivots first, each above `least`: in the order of the rows small shares can add up
    unseen, until the last pivots are rounding.
    """
    if np.max(np.diag(block)) <= least:  # LAPACK takes the first pivot, however small
        return np.zeros(0, np.int64)
    _, order, rank, _ = dpstrf(block, tol=least, lower=1)
    return np.sort(order[:rank] - 1)
