"""A linear model with a level for each group, for the search for gross errors.

The fit without rows O is known from the fit of all rows: with the residuals e and the residual maker M of all, the
left-out rows deviate from the prediction of the others by M_OO^-1 e_O, with covariance sigma^2 M_OO^-1, and the
residual sum of squares falls by e_O' M_OO^-1 e_O (Cook and Weisberg, Residuals and Influence in Regression, 1982,
section 2.2). So no second fit is needed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fitter.arrays import FloatArray, IntArray
from fitter.linear import orthonormal

NO_GROUP = -1
"""Group of a row without a common level."""
ENOUGH = 1e-11
"""Relative size of singular values of the scaled products that count as zero."""
AT_ONCE = 1 << 15
"""Rows at a time where a copy of all would be as much memory as all else."""


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

    @classmethod
    def equal(cls, columns: FloatArray, group: IntArray) -> Rows:
        """Of equal weight, for several responses (`of`). `columns` are overwritten by their basis, which spans the
        same beside the levels: of a million rows, each copy is as much memory as all else.
        """
        n, length = len(group), np.sqrt(np.einsum("ij,ij->j", columns, columns))
        bare = cls(columns, np.zeros(n), np.ones(n), group)
        basis = orthonormal(bare.within(columns, overwrite=True), length, overwrite=True)
        made = cls(basis, bare.y, bare.weight, group)
        made.__dict__["basis"] = basis
        return made

    def of(self, y: FloatArray) -> Rows:
        """The same rows with another weighted response (n,)."""
        other = Rows(self.columns, y, self.weight, self.group)
        other.__dict__.update(basis=self.basis, kept=self.kept)
        return other

    @property
    def groups(self) -> int:
        """Number of groups."""
        return int(self.group.max(initial=NO_GROUP)) + 1

    def within(self, values: FloatArray, *, overwrite: bool = False) -> FloatArray:
        """(n, m) `values` minus their groups' levels."""
        if self.groups == 0:
            return values
        inside = self.group >= 0
        at, mine = self.group[inside], self.weight[inside]
        out = values if overwrite else values.copy(order="F")
        for column, level in zip(out.T, self._levels(values.T), strict=True):
            column[inside] -= mine * level[at]
        return out

    def _levels(self, values: Iterable[FloatArray], kept: FloatArray | None = None) -> Iterator[FloatArray]:
        """(groups,) levels of every (n,) of `values`, estimated with weights `kept` (n,) or equal ones."""
        inside = self.group >= 0
        at, mine = self.group[inside], self.weight[inside]
        shares = mine if kept is None else mine * kept[inside]
        norms = np.maximum(np.bincount(at, shares * mine, minlength=self.groups), np.finfo(float).tiny)
        for column in values:
            yield np.bincount(at, shares * column[inside], minlength=self.groups) / norms

    def _blocks(self, kept: FloatArray) -> Callable[[], Iterator[tuple[slice, FloatArray, FloatArray]]]:
        """Some rows at a time, their columns (m, k), and their response (m,), all minus their groups' levels."""
        levels = np.stack(list(self._levels([*self.columns.T, self.y], kept)), axis=1) if self.groups else None

        def blocks() -> Iterator[tuple[slice, FloatArray, FloatArray]]:
            for first in range(0, len(self.y), AT_ONCE):
                some = slice(first, first + AT_ONCE)
                columns, y = self.columns[some], self.y[some]
                if levels is not None:
                    group = self.group[some]
                    off = np.where(group >= 0, self.weight[some], 0.0)[:, None] * levels[group]
                    columns, y = columns - off[:, :-1], y - off[:, -1]
                yield some, columns, y

        return blocks

    @cached_property
    def basis(self) -> FloatArray:
        """(n, rank) orthonormal columns beside the groups' levels."""
        own = bool(self.groups)
        return orthonormal(self.within(self.columns), np.linalg.norm(self.columns, axis=0), overwrite=own)

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
        share: FloatArray = 1.0 - np.einsum("ij,ij->i", self.basis, self.basis)
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
        spread = -(self.basis @ (self.basis[out].T @ off))
        spread[out] += off
        if self.groups:
            inside, mine = self.group >= 0, self.group[out] >= 0
            at = self.group[out][mine]
            level = np.bincount(at, (self.weight[out] * off)[mine], minlength=self.groups) / self._norms
            spread[inside] -= self.weight[inside] * level[self.group[inside]]
        return np.asarray(spread)

    def residual_of(self, kept: FloatArray) -> FloatArray:
        """(n,) residuals of all rows from a fit with these weights (n,), as a start."""
        k, blocks = self.columns.shape[1], self._blocks(kept)
        products, with_y = np.zeros((k, k)), np.zeros(k)
        for some, columns, y in blocks():
            weighted = kept[some][:, None] * columns
            products += columns.T @ weighted
            with_y += weighted.T @ y
        length = np.sqrt(np.diag(products))
        length[length == 0.0] = 1.0
        inverse = np.linalg.pinv(products / np.outer(length, length), ENOUGH, hermitian=True)
        coefficients = inverse @ (with_y / length) / length
        left = np.empty(len(self.y))
        for some, columns, y in blocks():
            left[some] = y - columns @ coefficients
        return left
