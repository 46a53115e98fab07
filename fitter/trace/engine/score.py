"""Score of each candidate beside the declared columns and the candidates already in the model.

A candidate is a block of columns. Its score is the F ratio of its reduction, exact for independent normal errors,
divided by the contribution of single rows if that is more than one (unequal variances; Eicker and White's estimate with
leverage taken out, MacKinnon and White, J. Econometrics 29 (1985) 305).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dpstrf, dtrtrs

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.linear import orthonormal
from rig.fitter.trace.engine.problem import SPARED, Problem
from rig.fitter.trace.engine.row_sums import pairs, row_sums, stretches

BoolArray = NDArray[np.bool_]
Apart = tuple[FloatArray, BoolArray, IntArray, IntArray, FloatArray]
Floats = NDArray[Any]
"""Double or single precision: a simulation may use less than a score."""
NOTHING_LEFT = 1e-3
"""Minimum remaining share of a column beside the model."""
CONSTANT = 1e-12
"""Share of a column's sum of squares about its mean, at least: less is rounding."""
NEARLY = 0.1
"""Remaining share of a column below which its rounding errors beside the model are removed once more."""
RESOLVED = 1e-12
"""Relative size of the response's range below which differences are rounding."""
FEWEST_FOR_SCATTER = 20
SHORTEST = 1e-150
"""Length of a column whose square is still a number."""
KEPT = 8
"""Bases of candidates that are kept: most are asked for a few times in turn."""


@dataclass(frozen=True, eq=False)
class Blocks:
    """Whitened candidates with the model's columns removed, each as an orthonormal basis.

    Attributes:
        units: (n, D) the bases side by side.
        start: (J + 1,) where each begins; an empty one cannot be judged.
    """

    units: Floats
    start: IntArray

    @cached_property
    def rank(self) -> IntArray:
        """(J,) columns of each."""
        return np.diff(self.start)

    @cached_property
    def squares(self) -> Floats:
        """(n, D)."""
        return np.asarray(self.units**2)

    def gains(self, outputs: Floats) -> Floats:
        """(J,) or (J, m): reduction of the sum of squares of outputs (n,) or (n, m) by each."""
        return self.sums((self.units.T @ outputs) ** 2)

    def sums(self, values: Floats) -> Floats:
        """(J,) or (J, m): sums over each block of values (D,) or (D, m) of its columns."""
        rank, start = self.rank, self.start[:-1]
        if np.all(rank == 1):  # most tables: each block is a column
            return values
        out = np.zeros((len(rank), *values.shape[1:]), values.dtype)
        for k in range(int(rank.max(initial=0))):  # few are wide; `add.reduceat` is three times slower
            wide = rank > k
            out[wide] += values[start[wide] + k]
        return out


@dataclass(frozen=True, eq=False)
class Scores:
    """One entry per candidate; zero and one for a candidate that is in the model or cannot be judged.

    Attributes:
        ratio: F, over the variance of independent rows.
        scatter: variance of its sums from contributions of single rows, relative to that; at least one.
        rank: number of added columns.
        df: degrees of freedom left beside it.
    """

    ratio: FloatArray
    scatter: FloatArray
    rank: IntArray
    df: IntArray

    @property
    def evidence(self) -> FloatArray:
        """(J,) twice the gain of the log-likelihood, each separately, for fixed noise."""
        return np.asarray(self.df * np.log1p(self.ratio * self.rank / self.df))


@dataclass(frozen=True, eq=False)
class View:
    """A problem under one covariance: everything whitened, the declared columns' basis, candidates' columns.

    Attributes:
        y: (n,) whitened response.
        basis: (n, k) orthonormal, of the declared columns.
        columns: (n, D) whitened candidates, with the declared columns removed.
        length: (D,) their lengths before that.
        start: (J + 1,).

    """

    y: FloatArray
    basis: FloatArray
    columns: FloatArray
    length: FloatArray
    start: IntArray
    _extra: dict[tuple[int, ...], FloatArray] = field(default_factory=dict)
    _rows: dict[int, FloatArray] = field(default_factory=dict)
    _of: list[tuple[FloatArray, FloatArray, FloatArray]] = field(default_factory=list)

    @cached_property
    def _products(self) -> tuple[FloatArray, FloatArray, IntArray]:
        """(D,) sums of squares of the columns, (p,) products within each pair, and (p,) where the pairs begin."""
        first = pairs(self.start)
        found = row_sums(self.columns, self.basis[:, :0], first)
        return found.squares, found.across, first

    @property
    def width(self) -> int:
        """Number of columns of candidates beside the declared ones."""
        return int(np.count_nonzero(self._apart(self._along(()))[1]))

    @property
    def rounding(self) -> float:
        """Sum of squares that is rounding and not error."""
        return len(self.y) * (RESOLVED * max(float(np.ptp(self.y)), np.finfo(float).tiny)) ** 2

    @classmethod
    def of(cls, problem: Problem, at: int) -> View:
        """Whiten a problem by covariance `at` of its noise."""
        which, sd = np.array([at]), problem.sd[:, None]
        own = problem.noise.whiten(which, np.column_stack([problem.y, problem.declared]) / sd)[0]
        basis, columns = orthonormal(own[:, 1:]), problem.noise.whiten(which, problem.scaled)[0]
        if np.may_share_memory(columns, problem.columns):
            columns = columns.copy()
        whole, total, along, _ = row_sums(columns, basis, pairs(problem.start)[:0])
        # about their means: for a constant a millionth of its length, or its rounding errors would be a column
        length = np.sqrt(np.maximum(whole - total**2 / problem.n, CONSTANT * whole))
        for rows in stretches(problem.n):
            columns[rows] -= basis[rows] @ along
        near = whole - np.einsum("ij,ij->j", along, along) < NEARLY**2 * whole
        if np.any(near):  # once leaves rounding errors of a column that is nearly declared
            columns[:, near] -= basis @ (basis.T @ columns[:, near])
        return cls(own[:, 0], basis, columns, length, problem.start)

    def only(self, terms: Sequence[int] | IntArray) -> View:
        """The same with some of the candidates alone."""
        picked, width = self.picked(terms), np.diff(self.start)[np.asarray(terms)]
        start = np.concatenate([[0], np.cumsum(width)])
        return View(self.y, self.basis, self.columns[:, picked], self.length[picked], start)

    def taken(self, chosen: Sequence[int]) -> FloatArray:
        """(n, q) orthonormal basis of the declared columns and some candidates."""
        if not chosen:
            return self.basis
        return np.hstack([self.basis, self.extra(chosen)])

    def extra(self, chosen: Sequence[int]) -> FloatArray:
        """(n, q) orthonormal basis of some candidates beside the declared columns."""
        key = tuple(chosen)
        if key not in self._extra:
            picked = self.picked(chosen)
            if len(self._extra) == KEPT:
                self._extra.clear()
            self._extra[key] = orthonormal(self.columns[:, picked], self.length[picked], NOTHING_LEFT)
        return self._extra[key]

    def gain(self, chosen: Sequence[int], left: FloatArray) -> float:
        """Reduction of the sum of squares of a residual (n,) beside the declared columns by some candidates.

        That of `extra`, from products of columns: Cholesky's triangle with pivoting is that of the basis.
        """
        picked = self.picked(chosen)
        columns = self.columns[:, picked] / np.maximum(self.length[picked], np.finfo(float).tiny)
        triangle, order, rank, _ = dpstrf(columns.T @ columns, tol=NOTHING_LEFT**2, lower=True)
        along = (columns.T @ left)[order[:rank] - 1]
        return float(np.sum(dtrtrs(triangle[:rank, :rank], along, lower=True)[0] ** 2)) if rank else 0.0

    def picked(self, chosen: Sequence[int] | IntArray) -> IntArray:
        """Columns of some candidates."""
        ranges = [np.arange(int(self.start[j]), int(self.start[j + 1])) for j in chosen]
        return np.concatenate(ranges) if ranges else np.empty(0, np.int64)

    def blocks(self, chosen: Sequence[int], of: Sequence[int]) -> Blocks:
        """Bases of a few candidates beside the declared columns and the `chosen`."""
        picked, extra = self.picked(of), self.extra(chosen)
        own, length = self.columns[:, picked], self.length[picked]
        for _ in range(2 if extra.shape[1] else 0):
            own = own - extra @ (extra.T @ own)
        ends = np.cumsum(np.diff(self.start)[list(of)])[:-1]
        bases = [
            orthonormal(some, size, NOTHING_LEFT)
            for some, size in zip(np.split(own, ends, axis=1), np.split(length, ends), strict=True)
        ]
        start = np.cumsum([0, *(basis.shape[1] for basis in bases)])
        return Blocks(np.hstack([own[:, :0], *bases]), start.astype(np.int64))

    def units(self) -> Blocks:
        """Bases of all candidates beside the declared columns, in single precision.

        From products of columns, as in `gains`, a stretch of rows at a time: all of it stays in the cache.
        """
        squares, kept, one, two, slope = self._apart(self._along(()))
        own = {j: self.blocks((), (j,)).units for j in np.flatnonzero(np.diff(self.start) > 2).tolist()}
        for j, basis in own.items():
            kept[self.start[j] : self.start[j + 1]] = np.arange(self.start[j + 1] - self.start[j]) < basis.shape[1]
        size = np.sqrt(np.where(kept, squares, 1.0))
        picked, out = np.flatnonzero(kept), np.empty((len(self.y), int(kept.sum())), np.float32)
        for rows in stretches(len(out)):
            some = self.columns[rows] / size
            some[:, two] -= some[:, one] * (slope * size[one] / size[two])
            out[rows] = some[:, picked]
        start = np.concatenate([[0], np.cumsum(kept)])[self.start].astype(np.int64)
        for j, basis in own.items():
            out[:, start[j] : start[j + 1]] = basis
        return Blocks(out, start)

    def gains(self, chosen: Sequence[int], y: FloatArray) -> tuple[FloatArray, IntArray]:
        """(J,) reductions of the sum of squares of `y` (n,) beside the `chosen` by each candidate, and ranks.

        The same as those of `blocks`, from products of columns: no basis of all candidates is made. A column that the
        others nearly replace keeps a millionth of its sum of squares, so cancellation leaves ten digits.
        """
        extra, beside, (y, along) = self.extra(chosen), self._along(chosen), self._with(y)
        squares, kept, one, two, slope = self._apart(beside)
        along = along - (extra.T @ y) @ beside
        along[two] -= slope * along[one]
        gain = np.divide(along**2, squares, out=np.zeros_like(squares), where=kept)
        ends = np.concatenate([[0], np.cumsum(kept)])[self.start]
        sums = np.concatenate([[0.0], np.cumsum(gain)])[self.start]
        ranks, out = np.diff(ends).astype(np.int64), np.diff(sums)
        wide = np.flatnonzero(np.diff(self.start) > 2)
        if wide.size:
            own = self.blocks(chosen, wide.tolist())
            ranks[wide], out[wide] = own.rank, own.gains(y - extra @ (extra.T @ y))
        return out, ranks

    def all_kept(self, chosen: Sequence[int]) -> BoolArray:
        """(D,) whether a column is certain to be in the `extra` basis together with all columns of the `chosen`.

        What a column has outside the others is the inverse of its diagonal element in the inverse of the products.
        """
        picked = self.picked(chosen)
        if self.extra(chosen).shape[1] < picked.size:
            return np.zeros(self.columns.shape[1], np.bool_)
        length, squares = np.maximum(self.length, SHORTEST), self._products[0]
        across = self._across(chosen) / length[picked, None] / length
        inverse = np.linalg.inv(across[:, picked])
        slope = inverse @ across
        own = squares / length**2 - np.einsum("ij,ij->j", across, slope)
        least = NOTHING_LEFT**2 * (1.0 + NOTHING_LEFT)
        most = np.max(np.diag(inverse)[:, None] * own + slope**2, axis=0, initial=0.0)
        return np.asarray((own > least) & (least * most < own))

    def _with(self, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(n,) a response beside the declared columns, and (D,) its products with all columns: many models have it."""
        if not self._of or not np.array_equal(self._of[0][0], y):
            left = y - self.basis @ (self.basis.T @ y)
            self._of[:] = [(y, left, left @ self.columns)]
        return self._of[0][1:]

    def _across(self, chosen: Sequence[int]) -> FloatArray:
        """(d, D) products of the columns of some candidates, which many models share, with all columns."""
        for j in chosen:
            if j not in self._rows:
                self._rows[j] = self.columns[:, self.start[j] : self.start[j + 1]].T @ self.columns
        return np.vstack([self.columns[:0], *(self._rows[j] for j in chosen)])

    def _along(self, chosen: Sequence[int]) -> FloatArray:
        """(q, D) products of the `extra` basis of some candidates with all columns."""
        extra, picked = self.extra(chosen), self.picked(chosen)
        if extra.shape[1] < picked.size:
            return np.asarray(extra.T @ self.columns)
        length = self.length[picked, None]
        basis = (extra.T @ self.columns[:, picked]).T / length
        return np.asarray(np.linalg.solve(basis, self._across(chosen) / length))

    def _apart(self, beside: FloatArray) -> Apart:
        """Columns of candidates of one or two, each beside the longer of its pair and a basis of products (q, D).

        (D,) their remaining sums of squares, and whether these are enough; (p,) the longer one of each pair, the
        other, and the slope (p,) of the other along it.
        """
        squares, across, first = self._products
        squares = squares - np.einsum("ij,ij->j", beside, beside)
        across = across - np.einsum("ij,ij->j", beside[:, first], beside[:, first + 1])
        return in_turn(squares, across, first, self.length)


def in_turn(squares: FloatArray, across: FloatArray, first: IntArray, length: FloatArray) -> Apart:
    """`Apart` from sums of squares (D,) beside a model and products (p,) within pairs that begin at `first` (p,).

    `length` (D,) are lengths without the model.
    """
    squares, second, kept = squares.copy(), first + 1, squares > (NOTHING_LEFT * length) ** 2
    swapped = _scaled(squares, length, second) > _scaled(squares, length, first)
    one, two = np.where(swapped, second, first), np.where(swapped, first, second)
    slope = np.divide(across, squares[one], out=np.zeros_like(across), where=kept[one])
    squares[two] -= slope * across
    kept[two] = kept[one] & (squares[two] > (NOTHING_LEFT * length[two]) ** 2)
    return squares, kept, one, two, slope


def ranked(view: View, y: FloatArray, chosen: Sequence[int]) -> Scores:
    """Score all candidates beside the `chosen`, but for the scatter of single rows, which takes the most time."""
    taken = view.taken(chosen)
    left = y - taken @ (taken.T @ y)
    gain, rank = view.gains(chosen, y)
    return _scores(view, left, len(y) - taken.shape[1], gain, rank)[0]


def score(view: View, y: FloatArray, chosen: Sequence[int], of: Sequence[int]) -> tuple[Scores, Blocks]:
    """Score a few candidates beside the `chosen`; a whitened response `y` (n,) replaces the view's own."""
    taken = view.taken(chosen)
    left = y - taken @ (taken.T @ y)
    found = view.blocks(chosen, of)
    scores, variance = _scores(view, left, len(y) - taken.shape[1], found.gains(left), found.rank)
    if len(y) < FEWEST_FOR_SCATTER:
        return scores, found
    return replace(scores, scatter=_scatter(found, left, variance)), found


def _scores(view: View, left: FloatArray, df: int, gain: FloatArray, rank: IntArray) -> tuple[Scores, FloatArray]:
    """Scores without scatter, and (J,) the variance of a row beside each candidate."""
    rss, floor = float(left @ left), view.rounding
    can = (rank > 0) & (df - rank >= SPARED) & (rss > floor)
    after = np.maximum(rss - gain, floor)
    df_after = np.where(can, df - rank, 1)
    variance = np.maximum(after / df_after, max(1e-100 * rss, np.finfo(float).tiny))
    ratio = np.where(can, gain / np.maximum(rank, 1) / variance, 0.0)
    return Scores(ratio, np.ones(len(rank)), rank, df_after), variance


def _scatter(found: Blocks, left: FloatArray, variance: FloatArray) -> FloatArray:
    """(J,) variance of a block's sums from contributions of single rows, over that from the variance of all; at least
    1.
    """
    out = np.ones(len(found.rank))
    single = np.flatnonzero(found.rank == 1)
    at = found.start[:-1]
    units = found.units[:, at[single]]
    after = left[:, None] - units * (units.T @ left)
    squares = found.squares[:, at[single]]
    free = np.maximum(1.0 - squares, 0.2)
    out[single] = np.sum(squares * after**2 / free, axis=0) / variance[single]
    for j in np.flatnonzero(found.rank > 1):
        span = slice(int(at[j]), int(at[j] + found.rank[j]))
        block, squared = found.units[:, span], found.squares[:, span]
        leverage = squared.sum(axis=1)
        rest = left - block @ (block.T @ left)
        own = rest**2 / np.maximum(1.0 - leverage, 0.2)
        out[j] = float(leverage @ own) / found.rank[j] / variance[j]
    return np.asarray(np.maximum(out, 1.0))


def _scaled(squares: FloatArray, length: FloatArray, at: IntArray) -> FloatArray:
    """Sums of squares of some columns over their squared lengths."""
    return np.asarray(squares[at] / np.maximum(length[at] ** 2, np.finfo(float).tiny))
