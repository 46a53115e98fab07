"""The two strata of readings in whole plots: what varies within them, and what varies from one to the next.

subplot      every whole plot's own offset is taken out, and what the declared model says within whole plots
whole-plot   one number a whole plot: its mean, less what the subplot stratum says of the declared model; then the
             declared model's terms that differ between whole plots only, or mostly

In a balanced design these are the strata of its analysis of variance. In any other the first is free of whole-plot
errors nevertheless, at the price of the little that whole plots' means say about it. A whole plot counts in the second
as precisely as it was measured; with one reading left it is still one number.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr as pivoted_qr

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.linear import orthonormal
from rig.fitter.sums_of_squares import project_out

Level = Literal["subplot", "whole-plot"]
LEVELS: tuple[Level, ...] = ("whole-plot", "subplot")

VARIES = 0.005
"""Maximum share of a column's variation within whole plots for a column of whole plots: temperatures are read with
every observation, and their scatter there has no information about their effect.
"""
MOSTLY = 0.1
"""Ratio of squares of the variation within and between whole plots that makes a declared term one of subplots."""
ROUNDED = 1e-12
"""The same, above which a declared term varies within whole plots at all."""
INDEPENDENT = 1e-6
"""Minimum remaining share of a column beside the others."""


@dataclass(frozen=True, eq=False)
class Strata:
    """Projections onto both strata, for one transducer.

    Attributes:
        declared: (n, k) columns of the declared model.
        whole_plot: (n,) index of each row's whole plot, from 0.
        replicate: (n,) index of the replication, from 0; each has its own offset.
        weight: (n,) of a reading, its variance's inverse up to a factor.
        ratio: variance of the whole-plot error over that of a reading of weight one.
        before: (n,) row of the previous reading in the whole plot; the row itself at the first.
        rho: correlation of a reading's error with that of the previous reading.
    """

    declared: FloatArray
    whole_plot: IntArray
    replicate: IntArray
    weight: FloatArray
    ratio: float
    before: IntArray
    rho: float = 0.0

    def whiten(self, columns: FloatArray) -> FloatArray:
        """(n, q) columns whitened so that readings' errors are independent with one variance."""
        scaled = columns * np.sqrt(self.weight)[:, None]
        if self.rho == 0.0:
            return scaled
        first = (self.before == np.arange(len(scaled)))[:, None]
        return np.where(first, scaled, (scaled - self.rho * scaled[self.before]) / np.sqrt(1.0 - self.rho**2))

    @cached_property
    def one(self) -> FloatArray:
        """(n,) the whitened constant."""
        return self.whiten(np.ones((self.weight.size, 1)))[:, 0]

    @cached_property
    def total(self) -> FloatArray:
        """(W,) weight of each whole plot's readings."""
        return np.asarray(np.bincount(self.whole_plot, self.one**2))

    @cached_property
    def precision(self) -> FloatArray:
        """(W,) root of the weight of each whole plot's mean."""
        return np.asarray(1.0 / np.sqrt(self.ratio + 1.0 / self.total))

    def df(self, level: Level) -> int:
        """Remaining degrees of freedom at a level."""
        if level == "whole-plot":
            return self.total.size - int(self.between.shape[1])
        return self.whole_plot.size - self.total.size - int(self._within[1].shape[1])

    def leave(self, columns: FloatArray, level: Level, means: FloatArray | None = None) -> FloatArray:
        """Remainder of (n, q) `columns`: (n, q) of readings over their standard deviations, or (W, q) of means.

        Args:
            columns: to be reduced.
            level: that of the remainder.
            means: (W, q) `means` of them, if known.
        """
        if level == "whole-plot":
            return project_out(
                (self.means(columns) if means is None else means) * self.precision[:, None], self.between
            )
        return project_out(self._centred(self._still(columns, means)), self._within[1])

    def varies_within(self, columns: FloatArray) -> NDArray[np.bool_]:
        """(q,) whether columns vary within whole plots by more than rounding and readback noise."""
        scaled, root = columns * np.sqrt(self.weight)[:, None], np.sqrt(self.weight)
        plots = np.arange(int(self.whole_plot.max()) + 1)[:, None] == self.whole_plot
        mean = (plots * (root / (plots @ self.weight)[self.whole_plot])) @ scaled
        centred = scaled - root[:, None] * mean[self.whole_plot]
        about = scaled - root[:, None] * (root @ scaled / self.weight.sum())
        rounding = 1e-9 * np.linalg.norm(scaled, axis=0)
        return np.asarray(np.linalg.norm(centred, axis=0) > VARIES * np.linalg.norm(about, axis=0) + rounding)

    @cached_property
    def _shares(self) -> FloatArray:
        """(W, n) share of each whitened reading in its whole plot's mean."""
        mine = np.arange(self.total.size)[:, None] == self.whole_plot
        return np.where(mine, self.one / self.total[:, None], 0.0)

    @property
    def log_determinant(self) -> float:
        """Logarithm of the determinants in the restricted likelihood, for the readings' covariance and the fitted
        coefficients.
        """
        followers = int(np.sum(self.before != np.arange(self.before.size)))
        covariance = followers * np.log(1.0 - self.rho**2) - np.sum(np.log(self.weight))
        fitted = np.sum(np.log(self.total)) + 2.0 * np.sum(np.log(np.abs(np.diag(self._within[2]))))
        return float(covariance + fitted)

    @property
    def kept(self) -> FloatArray:
        """(n,) share of a reading's variance in the subplot stratum, one minus its leverage."""
        return np.asarray(1.0 - self.one**2 / self.total[self.whole_plot] - np.sum(self._within[1] ** 2, axis=1))

    def means(self, columns: FloatArray) -> FloatArray:
        """(W, q) means over whole plots of the residuals of the declared model, with coefficients of the subplots."""
        picked, basis, triangle = self._within
        if not len(picked):
            return self._mean(columns)
        return self._mean(
            columns - self.declared[:, picked] @ np.linalg.solve(triangle, basis.T @ self._centred(columns))
        )

    def _still(self, columns: FloatArray, means: FloatArray | None) -> FloatArray:
        """(n, q) columns minus the contribution within whole plots of declared terms known from their means.

        It is negligible, unless a temperature was still settling when readings began.
        """
        rest, moving = self._mostly_between
        if not np.any(moving):
            return columns
        means = self.means(columns) if means is None else means
        known = self._between_inverse[np.flatnonzero(moving)] @ (means * self.precision[:, None])
        return columns - self.declared[:, rest[moving]] @ known

    def _mean(self, columns: FloatArray) -> FloatArray:
        return np.asarray(self._shares @ self.whiten(columns))

    def _centred(self, columns: FloatArray) -> FloatArray:
        white = self.whiten(columns)
        return np.asarray(white - self.one[:, None] * (self._shares @ white)[self.whole_plot])

    @cached_property
    def _mostly_between(self) -> tuple[IntArray, NDArray[np.bool_]]:
        """Declared columns that vary mostly between whole plots, and which of them also vary within.

        However little they do: what a transducer shows for a tenth of a degree may be more than its reading's error.
        """
        means, weight = self._mean(self.declared), self.total
        between = np.sum(weight[:, None] * (means - weight @ means / weight.sum()) ** 2, axis=0)
        varying, within = self.varies_within(self.declared), np.sum(self._centred(self.declared) ** 2, axis=0)
        rest = np.flatnonzero(~varying | (within < MOSTLY * between))
        return rest, np.asarray(within[rest] > ROUNDED * between[rest])

    @cached_property
    def _within(self) -> tuple[IntArray, FloatArray, FloatArray]:
        """Declared columns that subplots determine: which, orthonormal basis (n, r), triangle (r, r) from it."""
        varying = np.setdiff1d(np.arange(self.declared.shape[1]), self._mostly_between[0])
        centred = self._centred(self.declared)
        length = np.linalg.norm(centred[:, varying], axis=0)
        _, r, order = pivoted_qr(centred[:, varying] / length, mode="economic", pivoting=True)
        picked = np.sort(varying[order[: int(np.sum(np.abs(np.diag(r)) > INDEPENDENT))]])
        q, r = np.linalg.qr(centred[:, picked])
        return picked, q, r

    @cached_property
    def _between_columns(self) -> FloatArray:
        """(W, c) the declared model's other terms and the replications, for whole plots' means."""
        replicates = np.eye(int(self.replicate.max()) + 1)[self.replicate]
        return np.column_stack([self.declared[:, self._mostly_between[0]], replicates[:, 1:]])

    @cached_property
    def between(self) -> FloatArray:
        """(W, m) orthonormal basis of those, over the errors of whole plots' means."""
        columns = self._between_columns
        length = np.linalg.norm(self._mean(columns) * self.precision[:, None], axis=0)
        return orthonormal(self.means(columns) * self.precision[:, None], length, INDEPENDENT)

    @cached_property
    def _between_inverse(self) -> FloatArray:
        """(c, W) their coefficients from whole plots' means over the standard deviations of these."""
        columns = self.means(self._between_columns) * self.precision[:, None]
        length = np.maximum(np.linalg.norm(columns, axis=0), np.finfo(float).tiny)
        return np.asarray(np.linalg.pinv(columns / length, rcond=1e-8) / length[:, None])
