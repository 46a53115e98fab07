"""Common noise of the rows of a group: whole plots, or replications."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Self

import numpy as np

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.trace.engine.noise import BoolArray
from rig.fitter.trace.engine.white import Along, ByComponents, White

RATIOS = (0.02, 0.05, 0.1, 0.2, 0.4, 0.7, 1.2, 2.0, 4.0, 8.0, 16.0, 40.0, 100.0, 400.0)
"""Variance of the common error of a group over that of a row in it."""
_LARGE, _PLACE, _MOST = 100.0, 8.0, 1e7
"""Ratio from which on the grid is moved, which ratio of the grid it is then at, and the largest factor."""


def scale_of(group: IntArray, y: FloatArray, declared: FloatArray) -> float:
    """Factor of the ratios for a response whose groups differ by far more than rows in them; 1 for any other.

    Args:
        group: (n,) group of each row, from zero.
        y: (n,) the response.
        declared: (n, k) columns of the declared model.
    """
    count = np.bincount(group).astype(np.float64)
    rows = np.column_stack([y, declared])
    means = np.column_stack([np.bincount(group, column) / count for column in rows.T])
    within, between = _variance(rows - means[group], len(count)), _variance(means, 0)
    if within is None or between is None:
        return 1.0
    ratio = between / max(within, between / (_MOST * _PLACE)) - float(np.mean(1.0 / count)) if between else 0.0
    return min(ratio / _PLACE, _MOST) if ratio > _LARGE else 1.0


def _variance(rows: FloatArray, taken: int) -> float | None:
    """Variance of the first column beside the others; None without degrees of freedom."""
    y, columns = rows[:, 0], rows[:, 1:]
    largest = np.abs(columns).max(axis=0, initial=0.0)
    columns = columns / np.where(largest > 0.0, largest, 1.0)
    found, _, rank, _ = np.linalg.lstsq(columns, y, rcond=1e-9)
    df = len(y) - taken - int(rank)
    return float(np.sum((y - columns @ found) ** 2)) / df if df > 0 else None


@dataclass(frozen=True, eq=False)
class Shared:
    """Rows of a group have a common error: whole plots, or replications.

    Attributes:
        group: (n,) group of each row, from zero.
        picked: the only used ratio of the grid; None for all.
        scale: factor of the ratios, for groups that differ by far more than rows in them.
        sd: (n,) standard deviation that each row was divided by, so that the common error is not common there; None
            for one of all.
    """

    group: IntArray
    picked: int | None = None
    scale: float = field(default=1.0, kw_only=True)
    sd: FloatArray | None = field(default=None, kw_only=True)

    @cached_property
    def _ratio(self) -> FloatArray:
        every = self.scale * np.array([0.0, *RATIOS])
        return every if self.picked is None else every[self.picked : self.picked + 1]

    @cached_property
    def _share(self) -> FloatArray:
        """(n,) of the common error in each row."""
        return np.ones(len(self.group)) if self.sd is None else 1.0 / self.sd

    @cached_property
    def _square(self) -> FloatArray:
        """(groups,) sum of squared shares: the number of rows, if each has all of it."""
        return np.bincount(self.group, self._share**2).astype(np.float64)

    @property
    def prior(self) -> FloatArray:
        """See `Noise`."""
        return np.ones(len(self._ratio))

    @property
    def slow(self) -> BoolArray:
        """See `Noise`."""
        return np.zeros(len(self._ratio), np.bool_)

    @property
    def drifting(self) -> BoolArray:
        """See `Noise`."""
        return np.zeros(len(self._ratio), np.bool_)

    @property
    def memory(self) -> FloatArray:
        """See `Noise`."""
        return np.ones(len(self._ratio))

    @cached_property
    def log_det(self) -> FloatArray:
        """See `Noise`."""
        return np.asarray(np.sum(np.log1p(self._ratio[:, None] * self._square), axis=1))

    def whiten(self, which: IntArray, columns: FloatArray) -> FloatArray:
        """See `Noise`."""
        means = self._means(columns)
        shrink = 1.0 - 1.0 / np.sqrt(1.0 + self._ratio[which, None] * self._square)
        return np.asarray(columns[None] - self._spread(shrink[:, :, None] * means[None]))

    def white(self, which: IntArray, columns: FloatArray) -> White:
        """See `Noise`."""
        ratio = self._ratio[which, None]
        sums = (self._means(columns) * self._square[:, None])[None]
        weight = (ratio / (1.0 + ratio * self._square))[:, None]
        return ByComponents((Along(np.arange(len(which)), columns, sums, weight),), len(which))

    def back(self, at: int, white: FloatArray) -> FloatArray:
        """See `Noise`: the matrix that whitens is symmetric."""
        return np.asarray(self.whiten(np.array([at]), white)[0])

    def colour(self, at: int, white: FloatArray) -> FloatArray:
        """See `Noise`."""
        stretch = np.sqrt(1.0 + self._ratio[at] * self._square)[:, None] - 1.0
        return np.asarray(white + self._spread(stretch * self._means(white)))

    def root(self, at: int, columns: FloatArray) -> FloatArray:
        """See `Noise`."""
        return self.colour(at, columns)

    def variances(self, at: int) -> FloatArray:
        """See `Noise`."""
        return np.asarray(1.0 + self._ratio[at] * self._share**2)

    def rows(self, kept: IntArray) -> Self:
        """See `Noise`."""
        group = np.asarray(np.unique(self.group[kept], return_inverse=True)[1], np.int64)
        return replace(self, group=group, sd=None if self.sd is None else self.sd[kept])

    def only(self, at: int) -> Self:
        """See `Noise`."""
        return replace(self, picked=at)

    def over(self, sd: FloatArray) -> Self:
        """See `Noise`."""
        return replace(self, sd=sd)

    def _means(self, columns: FloatArray) -> FloatArray:
        """(groups, m) means, weighted by the shares."""
        sums = np.zeros((len(self._square), columns.shape[1]))
        np.add.at(sums, self.group, columns if self.sd is None else columns * self._share[:, None])
        return np.asarray(sums / self._square[:, None])

    def _spread(self, of_group: FloatArray) -> FloatArray:
        """(..., n, m) what each row has of values (..., groups, m)."""
        rows = of_group[..., self.group, :]
        return rows if self.sd is None else np.asarray(rows * self._share[:, None])
