"""Products of candidates' columns in strata of independent errors, and draws of them."""

from __future__ import annotations

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

Single = NDArray[np.float32]
_TINY = np.finfo(float).tiny


@dataclass(frozen=True, eq=False)
class Stratum:
    """Products beside the declared model in one stratum.

    Attributes:
        own: (d,) columns that are not zero in it.
        response: (d,) products of these with the response.
        square: sum of squares of the response.
        df: degrees of freedom.
        columns: (d, d) products of the columns; None if rows are known.
        rows: (r, d) with these products, of a stratum that has few.
    """

    own: IntArray
    response: FloatArray
    square: float
    df: float
    columns: FloatArray | None = None
    rows: FloatArray | None = None

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

    def of(self, these: IntArray, those: IntArray) -> FloatArray:
        """Products of columns, of one shape or broadcast."""
        if self.columns is not None:
            return self._padded[self.at(these), self.at(those)]
        one, other = (self._padded[self.at(picked)] for picked in (these, those))
        return np.asarray(np.einsum("...r,...r->...", one, other))

    def dots(self, picked: IntArray) -> FloatArray:
        """Products of columns with the response."""
        return np.append(self.response, 0.0)[self.at(picked)]

    @cached_property
    def _padded(self) -> FloatArray:
        """(d + 1, ...) products of columns, or their rows, with zeros for all other columns."""
        if self.columns is not None:
            return np.pad(self.columns, (0, 1))
        assert self.rows is not None
        return np.pad(self.rows.T, ((0, 1), (0, 0)))

    @cached_property
    def root(self) -> FloatArray:
        """(r, d) whose product with itself is that of the columns."""
        if self.rows is not None:
            return self.rows
        assert self.columns is not None
        size = np.sqrt(np.maximum(np.diag(self.columns), _TINY))
        triangle, order, rank, _ = dpstrf(self.columns / size / size[:, None], tol=1e-10, lower=False)
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
    """

    weight: FloatArray = field(kw_only=True)
    df: FloatArray = field(kw_only=True)
    price: FloatArray = field(default_factory=lambda: np.zeros(1), kw_only=True)
    shape: FloatArray = field(default_factory=lambda: np.zeros((1, 0)), kw_only=True)

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
    """

    strata: tuple[Stratum, ...] = field(kw_only=True)
    length: FloatArray = field(kw_only=True)

    def under(self, noise: OfStrata, length: FloatArray) -> InStrata:
        """The same under other variances, with what does not depend on them."""
        other = replace(self, noise=noise, length=length)
        vars(other).update(start=self.start, alike=self.alike, blocks=self.blocks, rowed=self.rowed, named=self.named)
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
        each = np.stack([one.of(these, those) for one in self.strata])
        return np.tensordot(self.weight[under], each, 1)

    def dots(self, picked: IntArray, under: IntArray | slice) -> FloatArray:
        """(G, d) products of columns with the response."""
        return np.tensordot(self.weight[under], np.stack([one.dots(picked) for one in self.strata]), 1)

    @cached_property
    def alike(self) -> tuple[tuple[IntArray, IntArray], ...]:
        """Candidates of q columns (U,), and these columns (U, q), for every q."""
        width = np.diff(self.start)
        same = [np.flatnonzero(width == q) for q in np.unique(width).tolist()]
        return tuple((of, self.start[of][:, None] + np.arange(int(width[of[0]]))) for of in same)

    @cached_property
    def blocks(self) -> list[FloatArray]:
        """(L, U, q, q) products within candidates in every stratum, for those of each width."""
        every = [(columns[:, :, None], columns[:, None, :]) for _, columns in self.alike]
        return [np.stack([one.of(*pair) for one in self.strata]) for pair in every]

    @cached_property
    def rowed(self) -> tuple[tuple[IntArray, list[int], Single], ...]:
        """Strata with few rows that have the same columns, by these: which they are, and all their rows (r, d)."""
        same = dict[int, list[int]]()
        for k, one in enumerate(self.strata):
            if one.rows is not None:
                same.setdefault(id(one.own), []).append(k)
        each = [(self.strata[of[0]].own, of, [self.strata[k].root for k in of]) for of in same.values()]
        return tuple((own, of, np.concatenate(rows).astype(np.float32)) for own, of, rows in each)


class Drawn(NamedTuple):
    """Errors of a stratum.

    Attributes:
        normal: (r, m) along its `root`.
        dots: (d, m) their products with its columns; none where it has few rows.
        squares: (m,) their sums of squares, with those of what no column has a part of.
    """

    normal: Single
    dots: Single
    squares: FloatArray


def draw(problem: InStrata, at: int, rng: np.random.Generator, count: int) -> list[Drawn]:
    """For each stratum m draws under a covariance."""
    out = []
    for one, weight in zip(problem.strata, problem.weight[at].tolist(), strict=True):
        sd, root = 1.0 / np.sqrt(weight), one.root
        normal = rng.standard_normal((len(root), count), dtype=np.float32) * np.float32(sd)
        squares = np.einsum("rm,rm->m", normal, normal, dtype=np.float64)
        if (rest := one.df - len(root)) > 0.0:
            squares = squares + rng.chisquare(rest, count) * sd**2
        few = one.rows is not None
        out.append(Drawn(normal, normal[:0] if few else root.T.astype(np.float32) @ normal, squares))
    return out


def summed(problem: InStrata, drawn: Sequence[Drawn], weight: FloatArray) -> Single:
    """(D, m) products of all columns with drawn errors under the variances of strata (L,)."""
    out = np.zeros((int(problem.start[-1]), drawn[0].normal.shape[1]), np.float32)
    for one, errors, part in zip(problem.strata, drawn, weight.tolist(), strict=True):
        if one.rows is None:
            out[one.own] += np.float32(part) * errors.dots
    for own, of, rows in problem.rowed:
        out[own] += rows.T @ np.concatenate([np.float32(weight[k]) * drawn[k].normal for k in of])
    return out
