"""Score of each candidate beside the declared columns and the candidates already in the model.

A candidate is a block of columns. Its score is the F ratio of its reduction, exact for independent normal errors,
divided by the contribution of single rows if that is more than one (unequal variances; Eicker and White's estimate with
leverage taken out, MacKinnon and White, J. Econometrics 29 (1985) 305).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fitter.arrays import FloatArray, IntArray
from fitter.linear import orthonormal
from procedures.general.trace.problem import SPARED, Problem

BoolArray = NDArray[np.bool_]
Floats = NDArray[Any]
"""Double or single precision: a simulation may use less than a score."""
NOTHING_LEFT = 1e-3
"""Minimum remaining share of a column beside the model."""
RESOLVED = 1e-12
"""Relative size of the response's range below which differences are rounding."""
FEWEST_FOR_SCATTER = 20


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


def blocks(columns: FloatArray, start: IntArray, length: FloatArray, taken: FloatArray) -> Blocks:
    """Orthonormal bases of candidates beside columns already in the model.

    Args:
        columns: (n, D) whitened.
        start: (J + 1,) where each candidate's begin.
        length: (D,) reference lengths.
        taken: (n, q) orthonormal basis of what the columns have not been freed of yet.
    """
    own = columns
    if taken.shape[1]:
        own = columns - taken @ (taken.T @ columns)
        own -= taken @ (taken.T @ own)
    norm = _lengths(own)
    kept = norm > NOTHING_LEFT * length
    widths = np.diff(start)
    unit = _over(own, norm, kept)
    first = start[:-1][widths == 2]
    if first.size:
        unit[:, first], unit[:, first + 1], kept[first], kept[first + 1] = _pairs(own, length, first)
    for j in np.flatnonzero(widths > 2):
        span = slice(int(start[j]), int(start[j + 1]))
        basis = orthonormal(own[:, span], length[span], NOTHING_LEFT)
        kept[span] = np.arange(widths[j]) < basis.shape[1]
        unit[:, start[j] : start[j] + basis.shape[1]] = basis
    ranks = np.diff(np.concatenate([[0], np.cumsum(kept)])[start])
    return Blocks(unit if kept.all() else unit[:, kept], np.concatenate([[0], np.cumsum(ranks)]).astype(np.int64))


def _pairs(own: FloatArray, length: FloatArray, first: IntArray) -> tuple[FloatArray, FloatArray, BoolArray, BoolArray]:
    """Orthonormal bases of pairs of columns, the longer of each first, and which of the two are independent."""
    scale = np.maximum(length, np.finfo(float).tiny)
    a, b = own[:, first] / scale[first], own[:, first + 1] / scale[first + 1]
    size_a, size_b = np.linalg.norm(a, axis=0), np.linalg.norm(b, axis=0)
    swapped = size_b > size_a
    if swapped.any():
        a[:, swapped], b[:, swapped] = b[:, swapped], a[:, swapped]
    size = np.where(swapped, size_b, size_a)
    long_kept = size > NOTHING_LEFT
    long = _over(a, size, long_kept)
    short = b - long * np.sum(long * b, axis=0)
    size = np.linalg.norm(short, axis=0)
    short_kept = long_kept & (size > NOTHING_LEFT)
    return long, _over(short, size, short_kept), long_kept, short_kept


def _over(columns: FloatArray, size: FloatArray, kept: BoolArray) -> FloatArray:
    """Columns over their size, zero where they are not kept."""
    return columns / size if kept.all() else np.divide(columns, size, out=np.zeros_like(columns), where=kept)


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

    @cached_property
    def _products(self) -> tuple[FloatArray, FloatArray, IntArray]:
        """(D,) sums of squares of the columns, (p,) products within each pair, and (p,) where the pairs begin."""
        first = self.start[:-1][np.diff(self.start) == 2]
        squares = np.einsum("ij,ij->j", self.columns, self.columns)
        return squares, np.einsum("ij,ij->j", self.columns[:, first], self.columns[:, first + 1]), first

    @property
    def rounding(self) -> float:
        """Sum of squares that is rounding and not error."""
        return len(self.y) * (RESOLVED * max(float(np.ptp(self.y)), np.finfo(float).tiny)) ** 2

    @classmethod
    def of(cls, problem: Problem, at: int) -> View:
        """Whiten a problem by covariance `at` of its noise."""
        k = problem.declared.shape[1]
        every = np.column_stack([problem.y, problem.declared, problem.columns]) / problem.sd[:, None]
        white = problem.noise.whiten(np.array([at]), every)[0]
        basis, columns = orthonormal(white[:, 1 : 1 + k]), np.ascontiguousarray(white[:, 1 + k :])
        length = _about(columns)
        for _ in range(2):  # once leaves rounding errors of a column that is nearly declared
            columns -= basis @ (basis.T @ columns)
        return cls(white[:, 0], basis, columns, length, problem.start)

    def taken(self, chosen: Sequence[int]) -> FloatArray:
        """(n, q) orthonormal basis of the declared columns and some candidates."""
        if not chosen:
            return self.basis
        return np.hstack([self.basis, self.extra(chosen)])

    def extra(self, chosen: Sequence[int]) -> FloatArray:
        """(n, q) orthonormal basis of some candidates beside the declared columns."""
        picked = self.picked(chosen)
        return orthonormal(self.columns[:, picked], self.length[picked], NOTHING_LEFT)

    def picked(self, chosen: Sequence[int]) -> IntArray:
        """Columns of some candidates."""
        ranges = [np.arange(self.start[j], self.start[j + 1]) for j in chosen]
        return np.concatenate(ranges) if ranges else np.empty(0, np.int64)

    def blocks(self, chosen: Sequence[int], of: Sequence[int] | None = None) -> Blocks:
        """Bases of candidates beside the declared columns and the `chosen`."""
        if of is None:
            return blocks(self.columns, self.start, self.length, self.extra(chosen))
        picked = self.picked(of)
        start = np.concatenate([[0], np.cumsum(np.diff(self.start)[list(of)])]).astype(np.int64)
        return blocks(self.columns[:, picked], start, self.length[picked], self.extra(chosen))

    def gains(self, chosen: Sequence[int], left: FloatArray) -> tuple[FloatArray, IntArray]:
        """(J,) reductions of the sum of squares of the residual beside the `chosen` by each candidate, and ranks.

        The same as those of `blocks`, from products of columns: no basis of all candidates is made. A column that the
        others nearly replace keeps a millionth of its sum of squares, so cancellation leaves ten digits.
        """
        extra = self.extra(chosen)
        squares, across, first = self._products
        along, second = left @ self.columns, first + 1
        beside = extra.T @ self.columns
        squares = squares - np.einsum("ij,ij->j", beside, beside)
        kept = squares > (NOTHING_LEFT * self.length) ** 2
        gain = np.divide(along**2, squares, out=np.zeros_like(squares), where=kept)
        if first.size:
            across = across - np.einsum("ij,ij->j", beside[:, first], beside[:, second])
            swapped = _scaled(squares, self.length, second) > _scaled(squares, self.length, first)
            one, two = np.where(swapped, second, first), np.where(swapped, first, second)
            slope = np.divide(across, squares[one], out=np.zeros_like(across), where=kept[one])
            short = squares[two] - slope * across
            kept[two] = kept[one] & (short > (NOTHING_LEFT * self.length[two]) ** 2)
            rest = (along[two] - slope * along[one]) ** 2
            gain[two] = np.divide(rest, short, out=np.zeros_like(short), where=kept[two])
        ends = np.concatenate([[0], np.cumsum(kept)])[self.start]
        sums = np.concatenate([[0.0], np.cumsum(gain)])[self.start]
        ranks, out = np.diff(ends).astype(np.int64), np.diff(sums)
        wide = np.flatnonzero(np.diff(self.start) > 2)
        if wide.size:
            own = self.blocks(chosen, wide.tolist())
            ranks[wide], out[wide] = own.rank, own.gains(left)
        return out, ranks


def ranked(view: View, y: FloatArray, chosen: Sequence[int]) -> Scores:
    """Score all candidates beside the `chosen`, but for the scatter of single rows, which takes the most time."""
    taken = view.taken(chosen)
    left = y - taken @ (taken.T @ y)
    gain, rank = view.gains(chosen, left)
    return _scores(view, left, len(y) - taken.shape[1], gain, rank)[0]


def score(view: View, y: FloatArray, chosen: Sequence[int], of: Sequence[int] | None = None) -> tuple[Scores, Blocks]:
    """Score candidates beside the `chosen`; a whitened response `y` (n,) replaces the view's own."""
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


def _about(columns: FloatArray) -> FloatArray:
    """(D,) lengths of columns about their means: their constant part is irrelevant.

    For a constant a millionth of its length; otherwise its rounding errors would count as a column.
    """
    about = _lengths(columns - columns.mean(axis=0))
    return np.asarray(np.maximum(about, 1e-6 * _lengths(columns)))


def _lengths(columns: FloatArray) -> FloatArray:
    """(D,) lengths of columns; `numpy.linalg.norm` takes four times as long over rows."""
    return np.asarray(np.sqrt(np.einsum("ij,ij->j", columns, columns)))


def _scaled(squares: FloatArray, length: FloatArray, at: IntArray) -> FloatArray:
    """Sums of squares of some columns over their squared lengths."""
    return np.asarray(squares[at] / np.maximum(length[at] ** 2, np.finfo(float).tiny))
