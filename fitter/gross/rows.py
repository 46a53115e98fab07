"""A linear model with a level for each group, for the search for gross errors.

The fit without rows O is known from the fit of all rows: with the residuals e and the residual maker M of all, the
left-out rows deviate from the prediction of the others by M_OO^-1 e_O, with covariance sigma^2 M_OO^-1, and the
residual sum of squares falls by e_O' M_OO^-1 e_O (Cook and Weisberg, Residuals and Influence in Regression, 1982,
section 2.2). So no second fit is needed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import numpy as np

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.linear import orthonormal
from rig.fitter.own_span import Levels, OwnSpan

ENOUGH = 1e-11
"""Relative size of singular values of the scaled products that count as zero."""


LEAST_ABSOLUTE = 12
"""Reweighted fits to least absolute values."""


class Span(Protocol):
    """Span of the columns beside the groups' levels, by an orthonormal basis Q."""

    @property
    def rank(self) -> int:
        """Number of columns of Q."""

    @property
    def leverage(self) -> FloatArray:
        """(n,) sums of squares of the rows of Q."""

    def at(self, rows: IntArray, /) -> FloatArray:
        """(m, rank) rows of Q."""

    def expand(self, coordinates: FloatArray, /) -> FloatArray:
        """(n,) Q times (rank,)."""

    def project_out(self, values: FloatArray, /) -> FloatArray:
        """(n,) part of values, levels removed, outside the span."""


@dataclass(frozen=True, eq=False)
class Held:
    """A span whose basis Q (n, rank) is in memory."""

    basis: FloatArray

    @property
    def rank(self) -> int:
        """Number of columns of Q."""
        return int(self.basis.shape[1])

    @cached_property
    def leverage(self) -> FloatArray:
        """(n,) sums of squares of the rows of Q."""
        return np.asarray(np.einsum("ij,ij->i", self.basis, self.basis))

    def at(self, rows: IntArray) -> FloatArray:
        """(m, rank) rows of Q."""
        return self.basis[rows]

    def expand(self, coordinates: FloatArray) -> FloatArray:
        """(n,) Q times (rank,)."""
        return np.asarray(self.basis @ coordinates)

    def project_out(self, values: FloatArray) -> FloatArray:
        """(n,) part of values, levels removed, outside the span."""
        return np.asarray(values - self.basis @ (self.basis.T @ values))


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows of a model, weighted by one over their standard deviation.

    Attributes:
        columns: (n, k) weighted columns.
        y: (n,) weighted response.
        weight: (n,) one over the standard deviation, up to a factor.
        group: (n,) from 0; rows of one group share a level. `NO_GROUP` for a row without.
        own: (n,) replication from 0, if every replication has its own coefficients of the columns; None if not.
    """

    columns: FloatArray
    y: FloatArray
    weight: FloatArray
    group: IntArray
    own: IntArray | None = None

    def of(self, y: FloatArray) -> Rows:
        """These rows with another weighted response (n,)."""
        other = replace(self, y=y)
        other.__dict__.update(levels=self.levels, span=self.span, kept=self.kept)
        return other

    def weighted(self, weight: FloatArray) -> Rows:
        """These rows, of equal weight so far, with these weights (n,)."""
        return Rows(self.columns * weight[:, None], self.y * weight, weight, self.group, self.own)

    def some(self, rows: IntArray) -> Rows:
        """Some rows (m,) alone."""
        group = self.group[rows]
        known = group >= 0
        group[known] = np.unique(group[known], return_inverse=True)[1]
        own = None if self.own is None else self.own[rows]
        return Rows(self.columns[rows], self.y[rows], self.weight[rows], group, own)

    @property
    def coefficients(self) -> int:
        """Number of coefficients beside the groups' levels."""
        return int(self.columns.shape[1]) * (1 if self.own is None else int(self.own.max()) + 1)

    @cached_property
    def levels(self) -> Levels:
        """The groups with their weights."""
        return Levels(self.group, None if np.all(self.weight == 1.0) else self.weight)

    @property
    def groups(self) -> int:
        """Number of groups."""
        return self.levels.count

    @cached_property
    def span(self) -> Span:
        """Span of the columns beside the groups' levels."""
        if self.own is not None:
            return OwnSpan(self.columns, self.own, self.levels)
        within = self.levels.project_out(self.columns)
        return Held(orthonormal(within, np.linalg.norm(self.columns, axis=0), overwrite=within is not self.columns))

    @cached_property
    def df(self) -> int:
        """Degrees of freedom for error in a fit of all rows."""
        return int(self.y.size - self.groups - self.span.rank)

    @cached_property
    def residual(self) -> FloatArray:
        """(n,) residuals of the fit of all rows, weighted."""
        return self.span.project_out(self.levels.project_out(self.y))

    @cached_property
    def least_absolute(self) -> FloatArray:
        """(n,) residuals of a fit by least absolute values, from that of all rows, weighted."""
        left = self.residual
        for _ in range(LEAST_ABSOLUTE):
            size = np.abs(left)
            left = self.residual_of(1.0 / np.maximum(size, 1e-3 * max(float(np.median(size)), 1e-300)))
        return left

    @cached_property
    def kept(self) -> FloatArray:
        """(n,) share of a row's variance in its residual of the fit of all rows."""
        share: FloatArray = 1.0 - self.span.leverage
        inside = self.levels.inside
        share[inside] -= self.weight[inside] ** 2 / self.levels.norms[self.group[inside]]
        return share

    def block(self, out: IntArray) -> FloatArray:
        """(k, k) rows and columns `out` of the residual maker M."""
        basis = self.span.at(out)
        made = np.eye(out.size) - basis @ basis.T
        if self.groups:
            weight, group = self.weight[out], self.group[out]
            same = (group[:, None] == group) & (group >= 0)
            made -= np.where(same, np.outer(weight, weight) / self.levels.norms[np.maximum(group, 0)], 0.0)
        return made

    def spread(self, out: IntArray, off: FloatArray) -> FloatArray:
        """(n,) what the deviations `off` (k,) of the rows `out` put into the residuals of all rows: M's columns."""
        spread = -self.span.expand(self.span.at(out).T @ off)
        spread[out] += off
        if self.groups:
            inside, mine = self.levels.inside, self.group[out] >= 0
            at = self.group[out][mine]
            level = np.bincount(at, (self.weight[out] * off)[mine], minlength=self.groups) / self.levels.norms
            spread[inside] -= self.weight[inside] * level[self.group[inside]]
        return np.asarray(spread)

    def residual_of(self, kept: FloatArray) -> FloatArray:
        """(n,) residuals of all rows from a fit with these weights (n,), as a start."""
        if isinstance(self.span, OwnSpan):
            products, with_y = self.span.weighted_products(kept, self.y)
            return self.levels.project_out(
                self.y - self.span.combined(self.span.inverse @ _solved(products, with_y)), kept
            )
        columns, y = self.levels.project_out(self.columns, kept), self.levels.project_out(self.y, kept)
        weighted = kept[:, None] * columns
        return np.asarray(y - columns @ _solved(columns.T @ weighted, weighted.T @ y))


def _solved(products: FloatArray, with_y: FloatArray) -> FloatArray:
    """(k,) coefficients by (k, k) products, that may be singular."""
    length = np.sqrt(np.diag(products))
    length[length == 0.0] = 1.0
    inverse = np.linalg.pinv(products / np.outer(length, length), ENOUGH, hermitian=True)
    return np.asarray(inverse @ (with_y / length) / length)
