"""The lowest of several minima of a problem with errors in the abscissa.

The sum of squared distances has many minima where a curve is steep or turns: least squares of the response alone is
pulled towards flat curves there, and the search from it stays in a minimum near by. No method is certain to find the
lowest; here are several kinds of start, and steps away from the best minimum. Starts descend together, roughly, on some
of the rows if they are many; only what is lower then is solved.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.linalg import LinAlgError
from numpy.typing import NDArray
from scipy import special

from rig.fitter import ties
from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.errors import FitError
from rig.fitter.nonlinear.nearest import Measured
from rig.fitter.nonlinear.problems import Distance, Weighted
from rig.fitter.nonlinear.solve import Solved, solve, solved_at

_SUBSETS, _BEST, _KICKS, _KICKED, _ROUNDS = 120, 6, 30, 4, 4
_SCALES, _SLOPES = (0.03, 0.3), 3
_SOME, _LOOKED_AT = 200, 40
"""Rows of a large table on which starts descend, and on which random ones are compared before."""
_DESCENT, _ENOUGH, _STUCK = 25, 1e-4, 1e6
_SOLVED, _PROMISE, _ALIKE, _APART = 4, 1e-6, 1e-2, 0.3
_TOLERANCE = 1e-9
"""Limits of the search from a start that is already near a minimum; Gauss-Newton steps end it."""
_ORDINARY = 1e-3
"""Probability that chi-squared of the right curve is larger. Below that limit there are no kicks."""
_SAME = 1e-9
_KEPT = 0.75
"""Share of the rows whose squares a robust comparison adds: the nearest ones (least trimmed squares)."""
_FAR = 3.0
"""Robust standard deviations beyond which a row is not in a robust fit."""


def solve_lowest(problem: Distance, start: FloatArray, *, robust: bool = False) -> Solved:
    """The lowest minimum that was found, from starts of several kinds; the same at every call.

    Starts are the given one, the fit without errors in the abscissa, fits with weights of the curve's slope, minima
    with smaller errors of one of both, and curves through few rows each. Then, unless chi-squared is ordinary, steps of
    a few standard errors away from the best.

    Args:
        problem: of n rows and k parameters.
        start: (k,) parameters.
        robust: for a few gross errors: least squares of the rows that are not far from the curve with the least sum of
            squares of the nearest three quarters. The loss of `solve` is not enough: a curve that is steep everywhere
            is near to every row.

    Raises:
        FitError: as `solve` from the given start, if no other start has a solution.
    """
    if not (problem.u_x > 0.0).any() or len(problem.y) <= len(start):
        return solve(problem, start, robust=robust)
    problem = replace(problem, known={})  # what was asked before changes no last digit
    rng = np.random.default_rng(0)
    some = _some(problem)
    near = _near(problem, some, start, robust=robust)
    made = np.vstack([start, near, _promising(some, _through_few(some, near[0], rng), _BEST, robust=robust)])
    descents = _descended(some, made, robust=robust)
    if robust:
        return _without_far_rows(problem, descents.b[0]) if np.isfinite(descents.heights[0]) else solve(problem, start)
    found = _lower(problem, None, descents)
    if found is None:
        return solve(problem, start)
    limit = special.chdtri(max(found.fit.df, 1), _ORDINARY)
    for _ in range(_ROUNDS):
        if found.fit.rss <= limit:
            break
        kicks = _promising(some, _kicks(found, rng), _KICKED)
        kicked = _lower(problem, found, _descended(some, np.vstack([found.fit.coefficients, kicks])))
        if kicked is None or kicked is found:
            break
        found = kicked
    return found


@dataclass(frozen=True, eq=False)
class _Descents:
    """Parameters near minima, the lowest first.

    Attributes:
        b: (s, k) parameters.
        heights: (s,) sums of squared distances, of the nearest rows if robust.
        normal: (s, k, k) of the normal equations there: a step of one standard error has the length one in it.
    """

    b: FloatArray
    heights: FloatArray
    normal: FloatArray

    def apart(self, i: int, b: FloatArray) -> float:
        """Distance of one from other parameters, in standard errors."""
        step = b - self.b[i]
        return float(np.sqrt(max(step @ self.normal[i] @ step, 0.0)))

    def distinct(self, count: int) -> list[int]:
        """The `count` lowest that differ."""
        kept: list[int] = []
        for i in range(len(self.b)):
            if np.isfinite(self.heights[i]) and all(self.apart(j, self.b[i]) > _APART for j in kept):
                kept.append(i)
        return kept[:count]


def _lower(problem: Distance, best: Solved | None, found: _Descents) -> Solved | None:
    """The best, or a solution from one of the descents that promises a lower one."""
    lowest = found.distinct(_SOLVED)
    if len(lowest) > 1 and len(problem.y) > _SOME:
        found = _descended(problem, found.b[lowest])
        lowest = found.distinct(_SOLVED)
    for i in lowest:
        if best is not None and not found.heights[i] < best.fit.rss * (1.0 - _PROMISE):
            alike = found.heights[i] < best.fit.rss * (1.0 + _ALIKE)
            if not alike or found.apart(i, best.fit.coefficients) < _APART:
                continue
        other = _tried(problem, found.b[i])
        if other is not None and (best is None or other.fit.rss < best.fit.rss * (1.0 - _SAME)):
            best = other
    return best


def _without_far_rows(problem: Distance, b: FloatArray) -> Solved:
    """Least squares of the rows that are not far from the curve with parameters `b`, and all rows at it."""
    left = np.abs(problem.residuals(b))
    near = np.flatnonzero(left <= _FAR * 1.4826 * np.median(left))
    found = _tried(problem.take(near), b)
    return solved_at(problem, b if found is None else found.fit.coefficients)


def _tried(problem: Distance | Weighted, b: FloatArray, *, robust: bool = False) -> Solved | None:
    try:
        return solve(problem, b, robust=robust, tolerance=_TOLERANCE)
    except (FitError, LinAlgError):
        return None


def _near(problem: Distance, some: Distance, start: FloatArray, *, robust: bool) -> FloatArray:
    """(s, k) fits of the response alone, with weights of the slope, and minima with smaller errors of either."""
    plain = _tried(Weighted(problem.curve, problem.table, problem.y, 1.0 / problem.u_y), start, robust=robust)
    made = [start if plain is None else plain.fit.coefficients]
    b = made[0]
    for _ in range(_SLOPES):
        slope = problem.curve.slope(b, problem.table, problem.name)
        weight = 1.0 / np.hypot(problem.u_y, slope * problem.u_x)
        weighted = _tried(Weighted(problem.curve, problem.table, problem.y, weight), b, robust=robust)
        if weighted is None:
            break
        b = weighted.fit.coefficients
    made.append(b)
    smaller = [pair for scale in _SCALES for pair in ((scale, 1.0), (1.0, scale))]
    made += list(_descended(some, np.tile(b, (len(smaller), 1)), np.array(smaller), robust=robust).b)
    return np.array(made)


def _through_few(problem: Distance, b: FloatArray, rng: np.random.Generator) -> FloatArray:
    """(s, k) curves through k to 3 k random rows, one of each part of the abscissa; linear steps from `b`."""
    columns = problem.curve.rows(b, problem.table)
    left = problem.y - problem.curve.value(b, problem.table)
    n, k = columns.shape
    order = np.argsort(problem.table[problem.name], kind="stable")
    made = np.empty((_SUBSETS, k))
    for i in range(_SUBSETS):
        size = min(k * (1 + i % 3), n)
        edges = np.linspace(0, n, size + 1)
        rows = order[np.minimum((edges[:-1] + rng.random(size) * np.diff(edges)).astype(int), n - 1)]
        made[i] = b + np.linalg.lstsq(columns[rows], left[rows], rcond=None)[0]
    return made


def _kicks(found: Solved, rng: np.random.Generator) -> FloatArray:
    """(s, k) steps of 1, 3 and 10 standard errors away, in random directions, with the errors' correlations."""
    root = found.fit.root
    steps = [(1.0, 3.0, 10.0)[i % 3] * root @ rng.normal(size=root.shape[1]) for i in range(_KICKS)]
    return found.fit.coefficients + np.array(steps)


def _some(problem: Distance, count: int = _SOME) -> Distance:
    """Rows that are evenly spread over the abscissa, if there are many."""
    n = len(problem.y)
    if n <= count:
        return problem
    order = np.argsort(problem.table[problem.name], kind="stable")
    return problem.take(np.sort(order[np.linspace(0, n - 1, count).astype(int)]))


def _promising(problem: Distance, made: FloatArray, count: int, *, robust: bool = False) -> FloatArray:
    """(count, k) or fewer: those with the least distances."""
    together = _Together(_some(problem, _LOOKED_AT), np.ones((len(made), 2)))
    measured, xi = together.at(np.arange(len(made)), made)
    heights, _ = _heights(measured.residuals(xi).reshape(len(made), -1), robust=robust)
    order = ties.descending(-heights, 0.0)[:count]
    return np.asarray(made[order[np.isfinite(heights[order])]])


class _Together:
    """Rows of a problem, once for each of s sets of parameters.

    Attributes:
        xi: (s, n) nearest abscissas of the last parameters, to begin the next search with.
    """

    def __init__(self, problem: Distance, scales: FloatArray) -> None:
        self._problem, self._scales, self._n = problem, scales, len(problem.y)
        self.xi = np.tile(problem.table[problem.name], (len(scales), 1))

    def at(self, which: IntArray, b: FloatArray) -> tuple[Measured, FloatArray]:
        """All rows of the sets `which` with parameters b (s, k), and their (s n,) nearest abscissas, roughly."""
        p, s = self._problem, len(b)
        table = {name: np.tile(column, s) for name, column in p.table.items()}
        u_x, u_y = (np.outer(self._scales[which, i], u).ravel() for i, u in enumerate((p.u_x, p.u_y)))
        measured = Measured(p.curve, np.repeat(b, self._n, axis=0), table, p.name, np.tile(p.y, s), u_x, u_y)
        return measured, measured.nearest(self.xi[which].ravel(), rough=True)[0]


def _descended(
    problem: Distance, made: FloatArray, scales: FloatArray | None = None, *, robust: bool = False
) -> _Descents:
    """A few steps of Levenberg and Marquardt from each of (s, k) parameters, with roughly the nearest points.

    Args:
        problem: of n rows.
        made: (s, k) parameters.
        scales: (s, 2) factors of `u_x` and of `u_y`, if they are not one.
        robust: with the nearest rows only.
    """
    together = _Together(problem, np.ones((len(made), 2)) if scales is None else scales)
    b = made.copy()
    height, normal, right = _equations(together, np.arange(len(b)), b, robust=robust)[:3]
    damping = np.full(len(b), 1e-3)
    active = np.flatnonzero(np.isfinite(height))
    for _ in range(_DESCENT):
        if not active.size:
            break
        i = active
        size = np.sqrt(np.maximum(np.diagonal(normal[i], axis1=1, axis2=2), 1e-300))
        scaled = normal[i] / (size[:, :, None] * size[:, None, :]) + damping[i, None, None] * np.eye(b.shape[1])
        there = b[i] + np.linalg.solve(scaled, (right[i] / size)[:, :, None])[:, :, 0] / size
        heights, normals, rights, xi = _equations(together, i, there, robust=robust)
        fall = height[i] - heights
        lower = fall > 0.0
        kept = i[lower]
        b[kept], together.xi[kept], height[kept] = there[lower], xi[lower], heights[lower]
        normal[kept], right[kept] = normals[lower], rights[lower]
        damping[i] = np.where(lower, np.maximum(0.1 * damping[i], 1e-9), 10.0 * np.maximum(damping[i], 1e-6))
        active = i[np.where(lower, fall > _ENOUGH * height[i], damping[i] < _STUCK)]
    order = ties.descending(-height, 0.0)
    return _Descents(b[order], height[order], normal[order])


def _equations(
    together: _Together, which: IntArray, b: FloatArray, *, robust: bool
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """(s,) heights, infinite where undefined; (s, k, k) normal matrices, (s, k) right sides, (s, n) abscissas."""
    measured, xi = together.at(which, b)
    shape = (len(b), -1)
    left, columns = measured.residuals(xi).reshape(shape), measured.columns(xi).reshape(*shape, b.shape[1])
    with np.errstate(all="ignore"):
        height, kept = _heights(left, robust=robust)
        weighted = np.where(kept[:, :, None], columns, 0.0)
        normal, right = np.matmul(weighted.transpose(0, 2, 1), weighted), np.einsum("snk,sn->sk", weighted, left)
    whole = np.isfinite(height) & np.isfinite(normal).all(axis=(1, 2)) & np.isfinite(right).all(axis=1)
    return np.where(whole, height, np.inf), normal, right, xi.reshape(shape)


def _heights(left: FloatArray, *, robust: bool) -> tuple[FloatArray, NDArray[np.bool_]]:
    """(s,) sums of squares of residuals (s, n), infinite where undefined, and (s, n) whether a row is in them."""
    kept = np.isfinite(left)
    whole = kept.all(axis=1)
    if robust:
        size = np.abs(left)
        count = int(np.ceil(_KEPT * left.shape[1])) - 1
        kept = size <= np.partition(size, count, axis=1)[:, count, None]
    return np.where(whole, np.sum(np.where(kept, left, 0.0) ** 2, axis=1), np.inf), kept
