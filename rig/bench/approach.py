"""Tables of approach: what a standard reads at settings of a source, for a first setting at a level of the reading."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise


def along(x: float, xs: Sequence[float], ys: Sequence[float]) -> float:
    """The value at `x`, linear between points of ascending abscissa and beyond them; constant for a single one."""
    if len(xs) == 1:
        return ys[0]
    at = next((k for k in range(len(xs) - 2) if x < xs[k + 1]), len(xs) - 2)
    return ys[at] + (x - xs[at]) * (ys[at + 1] - ys[at]) / (xs[at + 1] - xs[at])


@dataclass(frozen=True)
class Approach:
    """A monotone table.

    Attributes:
        settings: of the source, ascending.
        readings: of the standard, ascending or descending.
    """

    settings: tuple[float, ...]
    readings: tuple[float, ...]

    @classmethod
    def of(cls, pairs: Sequence[Sequence[float]]) -> Approach:
        """From pairs of setting and reading, in any order. Raises `ValueError` if they are not monotone."""
        settings, readings = zip(*sorted(map(tuple, pairs)), strict=True)
        up, across = ([b - a for a, b in pairwise(one)] for one in (settings, readings))
        if not up or not all(up) or not (all(step > 0 for step in across) or all(step < 0 for step in across)):
            raise ValueError("two pairs or more, each [setting, reading]; readings only rise, or only fall, with it")
        return cls(settings, readings)

    def reading(self, setting: float) -> float:
        """The reading of the standard at a setting."""
        return along(setting, self.settings, self.readings)

    def setting(self, reading: float) -> float:
        """The setting at which the standard reads this."""
        way = 1 if self.readings[-1] > self.readings[0] else -1
        return along(reading, self.readings[::way], self.settings[::way])

    def covers(self, reading: float) -> bool:
        """Whether a reading is between the lowest and the highest of the table."""
        return min(self.readings) <= reading <= max(self.readings)
