"""Factors of a design: the settings that a point may have, and the range in which the calibration is used."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rig.fitter.arrays import FloatArray
from rig.fitter.errors import FitError

GRID = 9
"""Settings of a free factor that a search tries before it refines them."""


@dataclass(frozen=True)
class Factor:
    """One factor of a design.

    Attributes:
        levels: settings a search may use, ascending; of a free factor a grid over its range.
        free: whether points may have any setting between the lowest and the highest level.
        category: whether nothing lies between the levels; otherwise the calibration is used over their whole range.
    """

    levels: tuple[float, ...]
    free: bool = False
    category: bool = False

    @classmethod
    def at(cls, levels: ArrayLike) -> Factor:
        """A factor set only at these levels, in any order; used over their whole range.

        Raises:
            FitError: there are no levels, or one is not finite.
        """
        return cls(_ascending(levels))

    @classmethod
    def within(cls, low: float, high: float, grid: int = GRID) -> Factor:
        """A factor set anywhere from `low` to `high`.

        Raises:
            FitError: `low` is not below `high`, or one is not finite.
        """
        if not (np.isfinite([low, high]).all() and low < high):
            raise FitError(f"a factor needs a range from a low to a high setting, not from {low} to {high}")
        return cls(_ascending(np.linspace(low, high, grid)), free=True)

    @classmethod
    def categories(cls, levels: ArrayLike) -> Factor:
        """A factor with nothing between its levels: ranges of a meter, operators by number."""
        return cls(_ascending(levels), category=True)

    @property
    def low(self) -> float:
        """Lowest setting."""
        return self.levels[0]

    @property
    def high(self) -> float:
        """Highest setting."""
        return self.levels[-1]

    def nodes(self, count: int) -> tuple[FloatArray, FloatArray]:
        """Settings and weights whose weighted mean is the mean over the region of use.

        Gauss-Legendre nodes over the range, exact for polynomials of degree 2 `count` - 1; the levels of a category, or
        the only level, with equal weights.
        """
        if self.category or len(self.levels) == 1:
            levels = np.array(self.levels)
            return levels, np.full(levels.size, 1.0 / levels.size)
        x, w = np.polynomial.legendre.leggauss(count)
        return np.asarray(0.5 * (self.low + self.high) + 0.5 * (self.high - self.low) * x), np.asarray(0.5 * w)

    def steps(self, count: int) -> FloatArray:
        """(.,) at least `count` settings that cover the region of use, levels and ends included."""
        levels = np.array(self.levels)
        if self.category or len(levels) == 1:
            return levels
        return np.union1d(np.linspace(self.low, self.high, count), levels)


def as_factors(given: Sequence[Factor | ArrayLike]) -> tuple[Factor, ...]:
    """Factors, where a plain sequence of numbers means `Factor.at`."""
    return tuple(each if isinstance(each, Factor) else Factor.at(each) for each in given)


def _ascending(levels: ArrayLike) -> tuple[float, ...]:
    values = np.unique(np.asarray(levels, np.float64))
    if values.size == 0 or not np.isfinite(values).all():
        raise FitError(f"a factor needs finite levels, not {values.tolist()}")
    return tuple(values.tolist())
