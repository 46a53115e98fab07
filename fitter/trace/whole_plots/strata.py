"""The two strata of readings in whole plots: what varies within them, and what varies from one to the next.

subplot      every whole plot's own offset is taken out, and what the declared model says within whole plots
whole-plot   one number a whole plot: its mean, less what the subplot stratum says of the declared model; then the
             declared model's terms that only differ between whole plots

In a balanced design these are the strata of its analysis of variance. In any other the first is free of whole-plot
errors all the same, at the price of the little that whole plots' means say about it. A whole plot counts in the second
as precisely as it was measured; with one reading left it is still one number.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr as pivoted_qr

from fitter.arrays import FloatArray, IntArray
from fitter.linear import orthonormal

Level = Literal["subplot", "whole-plot"]
LEVELS: tuple[Level, ...] = ("whole-plot", "subplot")

VARIES = 0.02
"""A column of which no larger share than this varies within whole plots is one of whole plots: temperatures are read
anew with every observation, and their scatter there says nothing about their effect."""
INDEPENDENT = 1e-6
"""A column of which no larger share than this is left beside the others adds nothing to them."""


@dataclass(frozen=True, eq=False)
class Strata:
    """Projections onto both strata, for one transducer.

    Attributes:
        declared: (n, k) columns of the declared model.
        whole_plot: (n,) which whole plot a row is in, from 0.
        replicate: (n,) which replication, from 0; each has an offset of its own.
        weight: (n,) of a reading, its variance's inverse up to a factor.
        ratio: variance of the whole-plot error over that of a reading of weight one.

    """

    declared: FloatArray
    whole_plot: IntArray
    replicate: IntArray
    weight: FloatArray
    ratio: float

    @cached_property
    def total(self) -> FloatArray:
        """(W,) weight of each whole plot's readings."""
        return np.asarray(np.bincount(self.whole_plot, self.weight))

    @cached_property
    def precision(self) -> FloatArray:
        """(W,) root of the weight of each whole plot's mean."""
        return np.asarray(1.0 / np.sqrt(self.ratio + 1.0 / self.total))

    def df(self, level: Level) -> int:
        """Degrees of freedom left at a level."""
        if level == "whole-plot":
            return self.total.size - int(self._between.shape[1])
        return self.whole_plot.size - self.total.size - int(self._within[1].shape[1])

    def leave(self, columns: FloatArray, level: Level) -> FloatArray:
        """What is left of (n, q) `columns`: (n, q) of readings over their standard deviations, or (W, q) of means."""
        if level == "whole-plot":
            return _off(self._between, self.means(columns) * self.precision[:, None])
        return _off(self._within[1], self._centred(columns))

    def varies_within(self, columns: FloatArray) -> NDArray[np.bool_]:
        """(q,) whether columns vary within whole plots by more than rounding and readback noise."""
        length = np.linalg.norm(columns * np.sqrt(self.weight)[:, None], axis=0)
        return np.asarray(np.linalg.norm(self._centred(columns), axis=0) > VARIES * length)

    @cached_property
    def _shares(self) -> FloatArray:
        """(W, n) share of each reading in its whole plot's mean."""
        mine = np.arange(self.total.size)[:, None] == self.whole_plot
        return np.where(mine, self.weight / self.total[:, None], 0.0)

    @property
    def kept(self) -> FloatArray:
        """(n,) share of a reading's variance that is left in the subplot stratum, one less its leverage."""
        return np.asarray(1.0 - self.weight / self.total[self.whole_plot] - np.sum(self._within[1] ** 2, axis=1))

    def means(self, columns: FloatArray) -> FloatArray:
        """(W, q) means over whole plots of what the declared model leaves, its coefficients those of the subplots."""
        picked, basis, triangle = self._within
        own = self.declared[:, picked]
        left = columns - own @ np.linalg.solve(triangle, basis.T @ self._centred(columns)) if len(picked) else columns
        return self._mean(left)

    def _mean(self, columns: FloatArray) -> FloatArray:
        return np.asarray(self._shares @ columns)

    def _centred(self, columns: FloatArray) -> FloatArray:
        return np.asarray((columns - self._mean(columns)[self.whole_plot]) * np.sqrt(self.weight)[:, None])

    @cached_property
    def _within(self) -> tuple[IntArray, FloatArray, FloatArray]:
        """Declared columns that subplots determine: which, orthonormal basis (n, r), triangle (r, r) from it."""
        varying = np.flatnonzero(self.varies_within(self.declared))
        centred = self._centred(self.declared)
        length = np.linalg.norm(centred[:, varying], axis=0)
        _, r, order = pivoted_qr(centred[:, varying] / length, mode="economic", pivoting=True)
        picked = np.sort(varying[order[: int(np.sum(np.abs(np.diag(r)) > INDEPENDENT))]])
        q, r = np.linalg.qr(centred[:, picked])
        return picked, q, r

    @cached_property
    def _between(self) -> FloatArray:
        """(W, m) orthonormal basis of what the declared model and the replications say of whole plots' means."""
        rest = np.setdiff1d(np.arange(self.declared.shape[1]), self._within[0])
        replicates = np.eye(int(self.replicate.max()) + 1)[self.replicate]
        columns = np.column_stack([self.declared[:, rest], replicates[:, 1:]])
        length = np.linalg.norm(self._mean(columns) * self.precision[:, None], axis=0)
        return orthonormal(self.means(columns) * self.precision[:, None], length, INDEPENDENT)


def _off(basis: FloatArray, columns: FloatArray) -> FloatArray:
    return np.asarray(columns - basis @ (basis.T @ columns))
