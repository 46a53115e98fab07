"""Tolerance intervals: what values of a quantity conform."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, isnan

from rig.fitter.errors import FitError


@dataclass(frozen=True)
class Tolerance:
    """Values that conform: from `lower` to `upper`, limits included.

    Attributes:
        lower: limit; -inf if there is none.
        upper: limit; inf if there is none.

    """

    lower: float = -inf
    upper: float = inf

    def __post_init__(self) -> None:
        if isnan(self.lower) or isnan(self.upper) or not self.lower < self.upper:
            raise FitError(
                f"a tolerance from {self.lower:g} to {self.upper:g}: the lower limit must be below the upper one"
            )
        if self.lower == -inf and self.upper == inf:
            raise FitError("a tolerance without limits: one of lower and upper is needed")

    def __contains__(self, value: float) -> bool:
        return self.lower <= value <= self.upper

    @property
    def width(self) -> float:
        """Width of the interval; infinite with one limit."""
        return self.upper - self.lower

    def narrowed(self, guard: float) -> Tolerance | None:
        """The interval with both limits moved inwards; None if no value is left. Outwards if negative."""
        lower, upper = self.lower + guard, self.upper - guard
        return Tolerance(lower, upper) if lower < upper else None

    @classmethod
    def around(cls, nominal: float, deviation: float) -> Tolerance:
        """Nominal value with a largest permitted deviation to both sides."""
        return cls(nominal - deviation, nominal + deviation)
