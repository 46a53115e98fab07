"""A linear model with a level for each group, as the search for gross errors needs it.

What leaving rows O out of a least-squares fit does is known from the fit of all rows: with the residuals e and the
residual maker M of all, the left-out rows are off the prediction of the others by M_OO^-1 e_O, with covariance
sigma^2 M_OO^-1, and the residual sum of squares falls by e_O' M_OO^-1 e_O (Cook and Weisberg, Residuals and Influence
in Regression, 1982, section 2.2). So no fit is made twice.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fitter.arrays import FloatArray, IntArray
from fitter.linear import orthonormal

NO_GROUP = -1
"""Group of a row that shares a level with no other."""
ENOUGH = 1e-11
"""Part of the largest singular value of the scaled products up to which one counts as none."""


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows of a model, weighted by one over their standard deviation.

    Attributes:
        columns: (n, k) weighted columns.
        y: (n,) weighted response.
        weight: (n,) one over the standard deviation, up to a factor.
        group: (n,) from 0; rows of one group share a level of their own. `NO_GROUP` where a row has none.

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
        """(n, m) `values` less their groups' levels, estimated with weights `kept` (n,) or all alike."""
        if self.groups == 0:
            return values
        v = self.weight if kept is None else self.weight * kept
        inside = self.group >= 0
        at = self.group[inside]
        sums = np.zeros((self.groups, values.shape[1]))
        np.add.at(sums, at, (v[:, None] * values)[inside])
        norms = np.bincount(at, (v * self.weight)[inside], minlength=self.groups)
        level = sums / np.maximum(norms, np.finfo(float).tiny)[:, None]
        out = values.copy()
        out[inside] -= self.weight[inside, None] * level[at]
        return out

    @cached_property
    def basis(self) -> FloatArray:
        """(n, rank) orthonormal columns beside the groups' levels."""
        return orthonormal(self.within(self.columns), np.linalg.norm(self.columns, axis=0))

    @cached_property
    def df(self) -> int:
        """Degrees of freedom left for error by a fit of all rows."""
        return int(self.y.size - self.groups - self.basis.shape[1])

    @cached_property
    def residual(self) -> FloatArray:
        """(n,) of the fit of all rows, weighted."""
        left = self.within(self.y[:, None])[:, 0]
        return np.asarray(left - self.basis @ (self.basis.T @ left))

    @cached_property
    def kept(self) -> FloatArray:
        """(n,) share of a row's variance that the fit of all leaves in its residual."""
        share: FloatArray = 1.0 - np.sum(self.basis**2, axis=1)
        inside = self.group >= 0
        norms = np.bincount(self.group[inside], self.weight[inside] ** 2, minlength=self.groups)
        share[inside] -= self.weight[inside] ** 2 / norms[self.group[inside]]
        return share

    def maker(self, out: IntArray) -> FloatArray:
        """(n, k) columns `out` of the residual maker M."""
        made = -self.basis @ self.basis[out].T
        made[out, np.arange(out.size)] += 1.0
        inside = self.group >= 0
        norms = np.bincount(self.group[inside], self.weight[inside] ** 2, minlength=self.groups)
        same = (self.group[:, None] == self.group[out][None, :]) & inside[:, None]
        shared = self.weight[:, None] * self.weight[out][None, :]
        if self.groups:
            made -= np.where(same, shared / norms[np.maximum(self.group[out], 0)][None, :], 0.0)
        return made

    def residual_of(self, kept: FloatArray) -> FloatArray:
        """(n,) residuals of all rows from a fit with these weights (n,), good enough to begin with."""
        both = self.within(np.column_stack([self.columns, self.y]), kept)
        columns, y = both[:, :-1], both[:, -1]
        products = columns.T @ (kept[:, None] * both)
        length = np.sqrt(np.diag(products[:, :-1]))
        length[length == 0.0] = 1.0
        inverse = np.linalg.pinv(products[:, :-1] / np.outer(length, length), ENOUGH, hermitian=True)
        return np.asarray(y - (columns / length) @ (inverse @ (products[:, -1] / length)))
