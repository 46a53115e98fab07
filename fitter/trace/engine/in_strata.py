"""Products of candidates' columns in strata of independent errors."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dpstrf

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.trace.engine.noise import BoolArray, Independent
from rig.fitter.trace.engine.problem import Problem
from rig.fitter.trace.engine.score import NOTHING_LEFT

Single = NDArray[np.float32]
LEAST_DF = 0.5
"""Degrees of freedom from which a part has a mean square of its own."""
_TINY = np.finfo(float).tiny


@dataclass(frozen=True, eq=False)
class Stratum:
    """Products beside the declared model in one stratum.

    Attributes:
        own: (d,) columns that are not zero in it.
        response: (d,) products of these with the response.
        square: sum of squares of the response.
        df: degrees of freedom.
        columns: (d + 1, d + 1) products of the columns, with zeros last for all others; None if rows are known.
        rows: (r, d) with these products, of a stratum that has few.
        whole: (d,) lengths of the columns before anything was taken out of them; None if they are those of `columns`.
    """

    own: IntArray
    response: FloatArray
    square: float
    df: float
    columns: FloatArray | None = None
    rows: FloatArray | None = None
    whole: FloatArray | None = None

    @classmethod
    def of_rows(cls, own: IntArray, rows: FloatArray, response: FloatArray) -> Stratum:
        """Few rows (r, d) of columns, and the response (r,)."""
        return cls(own, rows.T @ response, float(response @ response), float(len(rows)), rows=rows)

    @cached_property
    def place(self) -> IntArray:
        """Row in the products of each column up to the last own one; d where it is zero."""
        out = np.full(int(self.own.max(initial=-1)) + 1, len(self.own))
        out[self.own] = np.arange(len(self.own))
        return out

    def at(self, picked: IntArray) -> IntArray:
        """Rows of some columns in the products, d for those that are zero."""
        inside = picked < len(self.place)
        return np.where(inside, self.place[np.where(inside, picked, 0)], len(self.own))

    @cached_property
    def padded(self) -> FloatArray:
        """(d + 1, ...) products of columns, or their rows, with zeros for all other columns."""
        if self.columns is not None:
            return self.columns
        assert self.rows is not None
        return np.pad(self.rows.T, ((0, 1), (0, 0)))

    def root(self) -> FloatArray:
        """(r, d) whose product with itself is that of the columns; r is at most the degrees of freedom.

        Columns are compared with what they were before anything was taken out: of one that is not in this stratum
        rounding is left, which would be one more direction, and errors drawn along it more than the stratum has.
        """
        if self.rows is not None:
            return self.rows
        assert self.columns is not None
        columns = self.columns[:-1, :-1]
        size = np.sqrt(np.maximum(np.diag(columns), 0.0)) if self.whole is None else self.whole
        over = np.divide(1.0, size, out=np.zeros_like(size), where=size > 0.0)
        triangle, order, rank, _ = dpstrf(columns * over * over[:, None], tol=1e-10, lower=False)
        rank = min(rank, round(self.df))
        out = np.zeros((rank, len(size)))
        out[:, order - 1] = np.triu(triangle)[:rank]
        return out * size


@dataclass(frozen=True, eq=False)
class OfStrata(Independent):
    """Variances of strata: a grid.

    Attributes:
        weight: (G, L) one over the variance of each stratum.
        df: (L,) its degrees of freedom.
        price: (G,) in nats, of covariances that are unlikely beforehand.
        shape: (G, C) logarithms of what tells covariances apart, by which a simulation is used for another.
        held: (C,) which of these are as without a candidate where its errors are those beside it.
    """

    weight: FloatArray = field(kw_only=True)
    df: FloatArray = field(kw_only=True)
    price: FloatArray = field(default_factory=lambda: np.zeros(1), kw_only=True)
    shape: FloatArray = field(default_factory=lambda: np.zeros((1, 0)), kw_only=True)
    held: BoolArray = field(default_factory=lambda: np.zeros(0, np.bool_), kw_only=True)

    @property
    def prior(self) -> FloatArray:
        """See `Noise`."""
        return np.ones(len(self.weight))

    @cached_property
    def log_det(self) -> FloatArray:
        """See `Noise`; with the prices."""
        return np.asarray(2.0 * self.price - np.log(self.weight) @ self.df)

    @property
    def slow(self) -> BoolArray:
        """See `Noise`."""
        return np.zeros(len(self.weight), np.bool_)

    @property
    def drifting(self) -> BoolArray:
        """See `Noise`."""
        return self.slow

    @property
    def memory(self) -> FloatArray:
        """See `Noise`."""
        return self.prior


@dataclass(frozen=True, eq=False)
class InStrata(Problem):
    """A problem without rows: its candidates' terms have columns of no length.

    Attributes:
        strata: products.
        length: (D,) lengths of all columns before the declared ones were taken out, over the rows' errors.
        part: (L,) number of each stratum's part: strata of one part have one mean square.
        scatter: (L,) the stratum of the same rows whose errors are scatter alone.
        of_error: (L,) whether a stratum is one of those whose mean square was the scatter of these rows.
        pooled: whether the scatter is that of all rows.
    """

    strata: tuple[Stratum, ...] = field(kw_only=True)
    length: FloatArray = field(kw_only=True)
    part: IntArray = field(kw_only=True)
    scatter: IntArray = field(kw_only=True)
    of_error: BoolArray = field(kw_only=True)
    pooled: bool = field(default=False, kw_only=True)

    def under(self, noise: OfStrata, length: FloatArray, *, pooled: bool) -> InStrata:
        """The same under other variances, with what does not depend on them."""
        other = replace(self, noise=noise, length=length, pooled=pooled)
        vars(other).update(start=self.start, alike=self.alike, blocks=self.blocks, rowed=self.rowed, named=self.named)
        vars(other).update(own=self.own, scale=self.scale, _alike=self._alike, _responses=self._responses)
        vars(other).update(signs=self.signs, most=self.most, price=self.price, bounded=self.bounded)
        return other

    @property
    def n(self) -> int:
        """Degrees of freedom beside the declared model."""
        return round(sum(one.df for one in self.strata))

    @property
    def weight(self) -> FloatArray:
        """(G, L) see `OfStrata`."""
        assert isinstance(self.noise, OfStrata)
        return self.noise.weight

    def picked(self, terms: Sequence[int]) -> IntArray:
        """Columns of some candidates."""
        every = [np.arange(self.start[j], self.start[j + 1]) for j in terms]
        return np.concatenate([np.empty(0, np.int64), *every])

    def products(self, these: IntArray, those: IntArray, under: IntArray | slice) -> FloatArray:
        """(G, ...) products of columns under some covariances."""
        return np.tensordot(self.weight[under], self.each(these, those), 1)

    def each(self, these: IntArray, those: IntArray) -> FloatArray:
        """(L, ...) products of columns in every stratum, of one shape or broadcast."""
        depth = max(these.ndim, those.ndim)
        these, those = (one.reshape((1,) * (depth - one.ndim) + one.shape) for one in (these, those))
        out = np.empty((len(self.strata), *np.broadcast_shapes(these.shape, those.shape)))
        for one, full, few, rows in self._alike:
            at, other = one.at(these), one.at(those)
            for k in full:
                padded = self.strata[k].padded
                some = padded[at, other] if self.strata[k].rows is None else np.sum(padded[at] * padded[other], axis=-1)
                out[k] = some
            if few.size:
                out[few] = rows[:, at] * rows[:, other]
        return out

    def dots(self, picked: IntArray, under: IntArray | slice) -> FloatArray:
        """(G, d) products of columns with the response."""
        return np.asarray(self.weight[under] @ self.each_dots(picked))

    def each_dots(self, picked: IntArray) -> FloatArray:
        """(L, d) the same in every stratum."""
        out = np.empty((len(self.strata), picked.size))
        for (one, full, few, _), responses in zip(self._alike, self._responses, strict=True):
            out[np.concatenate([np.array(full, np.int64), few])] = responses[:, one.at(picked)]
        return out

    @cached_property
    def _alike(self) -> tuple[tuple[Stratum, list[int], IntArray, FloatArray], ...]:
        """Strata that have the same columns: one of them, those of products, those of one row, and these rows."""
        same = dict[int, list[int]]()
        for k, one in enumerate(self.strata):
            same.setdefault(id(one.own), []).append(k)
        out = []
        for every in same.values():
            few = [k for k in every if (rows := self.strata[k].rows) is not None and len(rows) == 1]
            rows = np.concatenate([self.strata[k].padded.T for k in few]) if few else np.empty((0, 0))
            out.append((self.strata[every[0]], [k for k in every if k not in few], np.array(few, np.int64), rows))
        return tuple(out)

    @cached_property
    def _responses(self) -> tuple[FloatArray, ...]:
        """Of these (l, d + 1) products with the response, and zeros for all other columns."""
        every = ([*full, *few.tolist()] for _, full, few, _ in self._alike)
        return tuple(np.pad(np.stack([self.strata[k].response for k in own]), ((0, 0), (0, 1))) for own in every)

    def rooted(self, picked: IntArray, products: FloatArray, under: IntArray | slice | int) -> FloatArray:
        """(..., q, q) rows that make columns orthonormal, each beside those before; zero for one that these replace.

        Args:
            picked: (..., q) the columns.
            products: of them, beside others or not.
            under: the covariances.

        """
        return rooted(products, np.maximum(self.lengths(under)[..., picked], _TINY))

    def lengths(self, under: IntArray | slice | int) -> FloatArray:
        """(..., D) `length` under some covariances: a large variance makes all of a column in its stratum short.

        The part that the declared model takes up is taken to be as much shorter as the rest.
        """
        plain = np.maximum(self.weight[0] @ self.own, _TINY)
        return np.asarray(self.length * np.sqrt(self.weight[under] @ self.own / plain))

    def beside(
        self, at: int, taken: IntArray, columns: IntArray, blocks: FloatArray | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Products beside some columns, under a covariance.

        Args:
            at: the covariance.
            taken: the columns in the model.
            columns: (..., q) others, in groups.
            blocks: (..., q, q) products within the groups, if they are known.

        Returns:
            (..., q, q) products within the groups, and (..., q) with the response.
        """
        under = np.array([at])
        if blocks is None:
            blocks = self.products(columns[..., :, None], columns[..., None, :], under)[0]
        dots = self.dots(columns.ravel(), under)[0].reshape(columns.shape)
        if not taken.size:
            return blocks, dots
        root = self.rooted(taken, self.products(taken[:, None], taken, under)[0], at)
        across = (root @ self.products(taken[:, None], columns.ravel(), under)[0]).reshape(-1, *columns.shape)
        along = root @ self.dots(taken, under)[0]
        left = blocks - np.einsum("p...q,p...r->...qr", across, across)
        return left, dots - np.einsum("p...q,p->...q", across, along)

    def told(self, weight: FloatArray, taken: IntArray, own: IntArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(q, q) products of some columns beside those `taken`, (q,) with the response, (q, q) beside nothing.

        Each fitted again under weights (L,) of the strata, such as those of one sensor.
        """
        every = np.concatenate([taken, own])
        products, dots = np.tensordot(weight, self.each(every[:, None], every), 1), weight @ self.each_dots(every)
        p = len(taken)
        root = rooted(products[:p, :p], np.sqrt(np.maximum(np.diag(products)[:p], _TINY)))
        across = root @ products[:p, p:]
        left = products[p:, p:] - across.T @ across
        return left, dots[p:] - across.T @ (root @ dots[:p]), products[p:, p:]

    def spread(self, at: int, picked: IntArray) -> FloatArray:
        """(q, q) inverse of the products of some columns under a covariance; zero for one that those before replace."""
        root = self.rooted(picked, self.products(picked[:, None], picked, np.array([at]))[0], at)
        return np.asarray(root.T @ root)

    def fitted(self, at: int, picked: IntArray) -> Fitted:
        """Some columns fitted together under a covariance; one that those before it replace has no coefficient.

        Each part of the strata that tells them has its own mean square, so few replications count as few
        (Satterthwaite, Biometrics Bulletin 2 (1946) 110). A part without an error of its own, and with none seen, is
        pooled with scatter.
        """
        weight, spread = self.weight[at], self.spread(at, picked)
        each, dots = self.each(picked[:, None], picked), self.each_dots(picked)
        value = spread @ (weight @ dots)
        squares = np.array([one.square for one in self.strata])
        rest = weight * (squares - 2.0 * dots @ value + np.einsum("lij,i,j->l", each, value, value))
        free = np.array([one.df for one in self.strata]) - weight * np.einsum("lij,ij->l", each, spread)
        part = self._pooled(weight, rest, free)
        meat, uncertain = np.zeros_like(spread), np.zeros(len(picked))
        for each_part in np.unique(part).tolist():
            mine = part == each_part
            df, own = float(free[mine].sum()), spread @ np.tensordot(weight[mine], each[mine], 1) @ spread
            square = max(float(rest[mine].sum()) / df, 0.0) if df > LEAST_DF else 1.0
            meat += square * own
            uncertain += (square * np.diag(own)) ** 2 / max(df, LEAST_DF)
        return Fitted(value, meat, np.diag(meat) ** 2 / np.maximum(uncertain, _TINY))

    def _pooled(self, weight: FloatArray, rest: FloatArray, free: FloatArray) -> IntArray:
        """(L,) parts with a mean square of their own, by weights, sums of squares and degrees of freedom (L,)."""
        out = self.part.copy()
        for one in np.unique(self.part).tolist():
            mine = self.part == one
            base = self.part[self.scatter[mine][0]]
            df, theirs = float(free[mine].sum()), self.part == base
            plain = bool(np.all(weight[mine] == weight[self.scatter[mine]]))
            most = float(rest[theirs].sum()) / max(float(free[theirs].sum()), LEAST_DF)
            if df <= LEAST_DF or (plain and float(rest[mine].sum()) <= most * df):
                out[mine] = base
        return out

    @cached_property
    def alike(self) -> tuple[tuple[IntArray, IntArray], ...]:
        """Candidates of q columns (U,), and these columns (U, q), for every q."""
        width = np.diff(self.start)
        same = [np.flatnonzero(width == q) for q in np.unique(width).tolist()]
        return tuple((of, np.add.outer(self.start[of], np.arange(int(width[of[0]])))) for of in same)

    @cached_property
    def blocks(self) -> list[FloatArray]:
        """(L, U, q, q) products within candidates in every stratum, for those of each width."""
        every = [(columns[:, :, None], columns[:, None, :]) for _, columns in self.alike]
        return [self.each(*pair) for pair in every]

    @cached_property
    def own(self) -> FloatArray:
        """(L, D) product of each column with itself in every stratum."""
        every = np.arange(int(self.start[-1]))
        return self.each(every, every)

    @cached_property
    def scale(self) -> FloatArray:
        """(D,) size of each column, by which draws in single precision are divided."""
        return np.asarray(np.sqrt(np.maximum(self.own.sum(axis=0), _TINY)))

    @cached_property
    def rowed(self) -> tuple[tuple[IntArray, list[int], Single], ...]:
        """Strata with few rows that have the same columns, by these: which they are, and all their rows (r, d)."""
        same = dict[int, list[int]]()
        for k, one in enumerate(self.strata):
            if one.rows is not None:
                same.setdefault(id(one.own), []).append(k)
        each = [(self.strata[of[0]].own, of, [self.strata[k].root() for k in of]) for of in same.values()]
        return tuple((own, of, (np.concatenate(rows) / self.scale[own]).astype(np.float32)) for own, of, rows in each)


class Fitted(NamedTuple):
    """Coefficients.

    Attributes:
        value: (q,) of each column.
        covariance: (q, q) of them; zero for a column that others replace.
        df: (q,) degrees of freedom of their errors.
    """

    value: FloatArray
    covariance: FloatArray
    df: FloatArray


def rooted(products: FloatArray, length: FloatArray) -> FloatArray:
    """(..., q, q) rows of Gram and Schmidt from products of columns of some `length` (..., q)."""
    q, least = products.shape[-1], NOTHING_LEFT**2
    if q > 1:  # the same by Cholesky, which is faster, where no column is replaced by those before
        with contextlib.suppress(np.linalg.LinAlgError):
            triangle = np.linalg.cholesky(products)
            if np.all(np.diagonal(triangle, axis1=-2, axis2=-1) ** 2 > least * length**2):
                return np.asarray(np.linalg.inv(triangle))
    out = np.zeros_like(products)
    for k in range(q):
        row = np.zeros(products.shape[:-1])
        row[..., k] = 1.0
        if k:
            along = np.einsum("...pq,...q->...p", out[..., :k, :], products[..., :, k])
            row = row - np.einsum("...p,...pq->...q", along, out[..., :k, :])
        left = np.einsum("...p,...pq,...q->...", row, products, row) if k else products[..., 0, 0]
        kept = left > least * length[..., k] ** 2
        out[..., k, :] = row * np.where(kept, 1.0 / np.sqrt(np.where(kept, left, 1.0)), 0.0)[..., None]
    return out
