"""A linear model with a level for each group, for the search for gross errors.

The fit without rows O is known from the fit of all rows: with the residuals e and the residual maker M of all, the
left-out rows deviate from the prediction of the others by M_OO^-1 e_O, with covariance sigma^2 M_OO^-1, and the
residual sum of squares falls by e_O' M_OO^-1 e_O (Cook and Weisberg, Residuals and Influence in Regression, 1982,
section 2.2). So no second fit is needed.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fitter.arrays import FloatArray, IntArray
from fitter.linear import orthonormal

NO_GROUP = -1
"""Group of a row without a common level."""
ENOUGH = 1e-11
"""Relative size of singular values of the scaled products that count as zero."""


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows of a model, weighted by one over their standard deviation.

    Attributes:
        columns: (n, k) weighted columns.
        y: (n,) weighted response.
        weight: (n,) one over the standard deviation, up to a factor.
        group: (n,) from 0; rows of one group share a level. `NO_GROUP` for a row without.
    """

    columns: FloatArray
    y: FloatArray
    weight: FloatArray
    group: IntArray

    @property
    def groups(self) -> int:
        """Number of groups."""
        return int(self.group.max(initial=NO_GROUP)) + 1

    def within(self, values: FloatArray, kept: FloatArray | None = None) -> FloatArray:
        """(n, m) `values` minus their groups' levels, estimated with weights `kept` (n,) or equal ones."""
        if self.groups == 0:
            return values
        inside = self.group >= 0
        at, mine = self.group[inside], self.weight[inside]
        shares = mine if kept is None else mine * kept[inside]
        norms = np.maximum(np.bincount(at, shares * mine, minlength=self.groups), np.finfo(float).tiny)
        out = values.copy(order="F")
        for column in out.T:
            level = np.bincount(at, shares * column[inside], minlength=self.groups) / norms
            column[inside] -= mine * level[at]
        return out

    @cached_property
    def basis(self) -> FloatArray:
        """(n, rank) orthonormal columns beside the groups' levels."""
        return orthonormal(self.within(self.columns), np.linalg.norm(self.columns, axis=0))

    @cached_property
    def df(self) -> int:
        """Degrees of freedom for error in a fit of all rows."""
        return int(self.y.size - self.groups - self.basis.shape[1])

    @cached_property
    def residual(self) -> FloatArray:
        """(n,) residuals of the fit of all rows, weighted."""
        left = self.within(self.y[:, None])[:, 0]
        return np.asarray(left - self.basis @ (self.basis.T @ left))

    @cached_property
    def kept(self) -> FloatArray:
        """(n,) share of a row's variance in its residual of the fit of all rows."""
        share: FloatArray = 1.0 - np.sum(self.basis**2, axis=1)
        inside = self.group >= 0
        share[inside] -= self.weight[inside] ** 2 / self._norms[self.group[inside]]
        return share

    @cached_property
    def _norms(self) -> FloatArray:
        """(groups,) sum of squared weights of each group."""
        inside = self.group >= 0
        return np.asarray(np.bincount(self.group[inside], self.weight[inside] ** 2, minlength=self.groups), np.float64)

    def block(self, out: IntArray) -> FloatArray:
        """(k, k) rows and columns `out` of the residual maker M."""
        made = np.eye(out.size) - self.basis[out] @ self.basis[out].T
        if self.groups:
            weight, group = self.weight[out], self.group[out]
            same = (group[:, None] == group) & (group >= 0)
            made -= np.where(same, np.outer(weight, weight) / self._norms[np.maximum(group, 0)], 0.0)
        return made

    def spread(self, out: IntArray, off: FloatArray) -> FloatArray:
        """(n,) what the deviations `off` (k,) of the rows `out` put into the residuals of all rows: M's columns."""
        spread = -self.basis @ (self.basis[out].T @ off)
        spread[out] += off
        if self.groups:
            inside, mine = self.group >= 0, self.group[out] >= 0
            at = self.group[out][mine]
            level = np.bincount(at, (self.weight[out] * off)[mine], minlength=self.groups) / self._norms
            spread[inside] -= self.weight[inside] * level[self.group[inside]]
        return np.asarray(spread)

    def residual_of(self, kept: FloatArray) -> FloatArray:
        """(n,) residuals of all rows from a fit with these weights (n,), as a start."""
        columns, y = self.within(self.columns, kept), self.within(self.y[:, None], kept)[:, 0]
        products = columns.T @ (kept[:, None] * columns)
        length = np.sqrt(np.diag(products))
        length[length == 0.0] = 1.0
        inverse = np.linalg.pinv(products / np.outer(length, length), ENOUGH, hermitian=True)
        return np.asarray(y - columns @ (inverse @ (columns.T @ (kept * y) / length) / length))
