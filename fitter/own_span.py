"""Span of every replication's own parameters beside the levels of groups, without a matrix of all its columns.

A model of L columns has n_rep L of them if every replication has its own parameters, and beside the levels of groups
they have no zeros. A row has values in one replication alone before the levels are removed, though, so what the
orthonormal basis Q = (O - levels) R^-1 is needed for follows from the n by L columns and a small triangle R, which is
made some groups at a time. Of a million rows and six replications Q would be 193 MB.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg.lapack import dgeqp3, dtrtri

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.linear import orthonormal
from rig.fitter.sums_of_squares import project_out

NO_GROUP = -1
"""Group of a row without a common level."""
AT_ONCE = 1 << 15
"""Rows whose columns are made at once, with those of the last group."""
TOLERANCE = 1e-7
"""Part of a column outside the others, relative to its length, below which it is dependent."""


@dataclass(frozen=True, eq=False)
class Levels:
    """Groups of rows that share a level.

    Attributes:
        group: (n,) from 0; `NO_GROUP` for a row without a level.
        weight: (n,) one over the standard deviation of each row, up to a factor; None if all are equal.
    """

    group: IntArray
    weight: FloatArray | None = None

    @cached_property
    def count(self) -> int:
        """Number of groups."""
        return int(self.group.max(initial=NO_GROUP)) + 1

    @cached_property
    def inside(self) -> IntArray | slice:
        """Rows that have a level."""
        return slice(None) if self.group.min(initial=0) >= 0 else np.flatnonzero(self.group >= 0)

    @cached_property
    def norms(self) -> FloatArray:
        """(groups,) sum of squared weights of each group."""
        return self.sums(None, squared=True)

    def sums(self, values: FloatArray | None, *, squared: bool = False) -> FloatArray:
        """(groups,) sums of (n,) values times weights, or their squares; of the latter alone without values."""
        mine = None if values is None else values[self.inside]
        if self.weight is not None:
            weight = self.weight[self.inside] ** 2 if squared else self.weight[self.inside]
            mine = weight if mine is None else mine * weight
        return np.asarray(np.bincount(self.group[self.inside], mine, minlength=self.count), np.float64)

    def project_out(self, values: FloatArray, kept: FloatArray | None = None) -> FloatArray:
        """(n,) or (n, m) weighted `values` minus their groups' levels, which `kept` (n,) more weights may estimate."""
        if self.count == 0:
            return values
        norms = self.norms if kept is None else self.sums(kept, squared=True)
        norms, at = np.maximum(norms, np.finfo(float).tiny), self.group[self.inside]
        out = values.copy(order="F")
        for column in out.T if out.ndim == 2 else [out]:
            level = (self.sums(column if kept is None else kept * column) / norms)[at]
            column[self.inside] -= level if self.weight is None else self.weight[self.inside] * level
        return out


@dataclass(frozen=True, eq=False)
class OwnSpan:
    """Span of a model's columns, once for each replication, beside groups' levels.

    Attributes:
        columns: (n, L) of the model, weighted.
        own: (n,) replication of each row, from 0.
        levels: groups of rows with a level of their own.
    """

    columns: FloatArray
    own: IntArray
    levels: Levels

    @property
    def rank(self) -> int:
        """Number of columns of the basis Q."""
        return int(self.inverse.shape[1])

    @cached_property
    def count(self) -> int:
        """Number of columns: replications times L."""
        return (int(self.own.max()) + 1) * int(self.columns.shape[1])

    @cached_property
    def _each(self) -> list[IntArray | slice]:
        """Rows of every replication; a slice, of which nothing is copied, where they follow one another."""
        each: list[IntArray | slice] = []
        for r in range(int(self.own.max()) + 1):
            rows = np.flatnonzero(self.own == r)
            apart = not rows.size or rows[-1] - rows[0] + 1 > rows.size
            each.append(rows if apart else slice(int(rows[0]), int(rows[-1]) + 1))
        return each

    def _blocks(self) -> Iterator[IntArray]:
        """Rows, some whole groups at a time."""
        group = self.levels.group
        ahead = np.argsort(group, kind="stable")
        new = np.flatnonzero(np.diff(group[ahead], prepend=NO_GROUP)) if self.levels.count else np.zeros(0, np.int64)
        # those without a level may be parted anywhere
        ends = np.r_[np.arange(0, new[0] if new.size else len(ahead), AT_ONCE), new, len(ahead)]
        first = 0
        while first < len(ahead):
            later = int(np.searchsorted(ends, first + AT_ONCE, side="right")) - 1
            last = int(ends[later] if ends[later] > first else ends[later + 1])
            yield ahead[first:last]
            first = last

    def _made(self, rows: IntArray) -> FloatArray:
        """(m, count) columns of these rows beside the levels of their groups, all rows of which have to be there."""
        size = self.columns.shape[1]
        made = np.zeros((len(rows), self.count // size, size))
        made[np.arange(len(rows)), self.own[rows]] = self.columns[rows]
        made = made.reshape(len(rows), self.count)
        group = self.levels.group[rows]
        first = int(np.searchsorted(group, NO_GROUP, side="right"))
        if first < len(rows):
            weight = None if self.levels.weight is None else self.levels.weight[rows[first:], None]
            inside = made[first:]
            starts = np.flatnonzero(np.diff(group[first:], prepend=NO_GROUP))
            sums = np.add.reduceat(inside if weight is None else inside * weight, starts, axis=0)
            sums /= self.levels.norms[group[first:][starts], None]
            level = np.repeat(sums, np.diff(np.r_[starts, len(inside)]), axis=0)
            inside -= level if weight is None else level * weight
        return made

    @cached_property
    def inverse(self) -> FloatArray:
        """(count, rank) R^-1, from the columns beside the levels to Q; zero for columns that depend on others."""
        triangle = np.zeros((0, self.count))
        for rows in self._blocks():
            triangle = np.asarray(np.linalg.qr(np.vstack([triangle, self._made(rows)]), mode="r"))
        length = np.sqrt(np.concatenate([np.sum(self.columns[rows] ** 2, axis=0) for rows in self._each]))
        length[length == 0.0] = 1.0
        reflected, order, _, _, _ = dgeqp3(triangle / length)
        sizes = np.abs(np.diag(reflected))
        rank = int(np.sum(sizes > TOLERANCE))
        kept = order[:rank] - 1
        inverse = np.zeros((self.count, rank))
        if rank:
            inverse[kept] = np.triu(dtrtri(reflected[:rank, :rank])[0]) / length[kept, None]
        return inverse

    def combined(self, coefficients: FloatArray) -> FloatArray:
        """(n,) or (n, m) columns times (count,) or (count, m) coefficients, levels not removed."""
        size = self.columns.shape[1]
        out = np.empty((len(self.own), *coefficients.shape[1:]))
        for r, rows in enumerate(self._each):
            out[rows] = self.columns[rows] @ coefficients[r * size : (r + 1) * size]
        return out

    def products(self, values: FloatArray) -> FloatArray:
        """(count,) or (count, m) products of the columns, levels not removed, with (n,) or (n, m) values."""
        return np.concatenate([self.columns[rows].T @ values[rows] for rows in self._each])

    def expand(self, coordinates: FloatArray) -> FloatArray:
        """(n,) or (n, m) Q times (rank,) or (rank, m)."""
        return self.levels.project_out(self.combined(self.inverse @ coordinates))

    def coordinates(self, values: FloatArray) -> FloatArray:
        """(rank,) or (rank, m) Q' times (n,) or (n, m)."""
        return np.asarray(self.inverse.T @ self.products(self.levels.project_out(values)))

    def weighted_products(self, kept: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(rank, rank) products of Q with itself and (rank,) with `y` (n,), with more weights `kept` (n,), which
        estimate the levels too.
        """
        size = self.columns.shape[1]
        products, with_y = np.zeros((self.count, self.count)), self.products(kept * y)
        for r, rows in enumerate(self._each):
            mine, columns = slice(r * size, (r + 1) * size), self.columns[rows]
            products[mine, mine] = columns.T @ (kept[rows, None] * columns)
        if self.levels.count:
            sums, norms = self._sums(kept)
            products -= sums.T @ sums
            of_y = self.levels.sums(kept * y) / norms
            with_y -= sums.T @ of_y
        return self.inverse.T @ products @ self.inverse, self.inverse.T @ with_y

    def _sums(self, kept: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(groups, count) weighted sums of the columns over groups, over (groups,) roots of the groups' weights."""
        levels, n_rep, size = self.levels, self.count // self.columns.shape[1], self.columns.shape[1]
        inside = levels.inside
        shares = kept[inside] if levels.weight is None else kept[inside] * levels.weight[inside]
        norms = np.sqrt(np.maximum(levels.sums(kept, squared=True), np.finfo(float).tiny))
        cell = levels.group[inside] * n_rep + self.own[inside]
        sums = np.empty((levels.count, n_rep, size))
        for j in range(size):
            of = np.bincount(cell, shares * self.columns[inside, j], minlength=levels.count * n_rep)
            np.divide(of.reshape(-1, n_rep), norms[:, None], out=sums[:, :, j])
        return sums.reshape(levels.count, self.count), norms

    def project_out(self, values: FloatArray) -> FloatArray:
        """Part of (n,) or (n, m) values, levels removed, outside the span."""
        return np.asarray(values - self.expand(self.inverse.T @ self.products(values)))

    def at(self, rows: IntArray) -> FloatArray:
        """(m, rank) these rows of Q."""
        group = self.levels.group
        needed = np.union1d(rows, np.flatnonzero((group >= 0) & np.isin(group, group[rows])))
        needed = needed[np.argsort(group[needed], kind="stable")]
        place = np.argsort(needed)
        return np.asarray((self._made(needed) @ self.inverse)[place[np.searchsorted(needed, rows, sorter=place)]])

    @cached_property
    def leverage(self) -> FloatArray:
        """(n,) sums of squares of the rows of Q."""
        out = np.empty(len(self.own))
        for rows in self._blocks():
            basis = self._made(rows) @ self.inverse
            out[rows] = np.einsum("ij,ij->i", basis, basis)
        return out


@dataclass(frozen=True, eq=False)
class WithMore:
    """An `OwnSpan` with a few further columns, held as an orthonormal basis.

    Attributes:
        span: of the replications' own parameters.
        more: (n, q) orthonormal, outside that span, levels removed.
    """

    span: OwnSpan
    more: FloatArray

    @classmethod
    def of(cls, span: OwnSpan, columns: FloatArray) -> WithMore:
        """With the part of (n, q) `columns` beside the span."""
        left = span.project_out(span.project_out(span.levels.project_out(columns)))
        return cls(span, orthonormal(left, np.linalg.norm(columns, axis=0)))

    @property
    def rank(self) -> int:
        """Number of columns of the basis."""
        return self.span.rank + int(self.more.shape[1])

    def expand(self, coordinates: FloatArray) -> FloatArray:
        """(n,) the basis times (rank,) coordinates."""
        own = self.span.rank
        return np.asarray(self.span.expand(coordinates[:own]) + self.more @ coordinates[own:])

    def coordinates(self, values: FloatArray) -> FloatArray:
        """(rank,) coordinates of (n,) values in the basis."""
        return np.concatenate([self.span.coordinates(values), self.more.T @ values])

    def project_out(self, values: FloatArray) -> FloatArray:
        """(n,) part of values outside the span; levels are removed before."""
        return project_out(self.span.project_out(values), self.more)
