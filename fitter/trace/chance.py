"""How often chance does as well as the best of all candidates: the share of false alarms, and how p are adjusted."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fitter.arrays import FloatArray

ALPHA = 0.035


COUNTED = 1 / 7
"""Share of ALPHA kept for tests that are counted one by one."""


DRAWS = 20_000


@dataclass(frozen=True, eq=False)
class Family:
    """What chance does.

    Attributes:
        smallest_p: smallest of all p in `DRAWS` runs in which nothing is missing, ascending.
        between: independent tests that those between replications amount to, by whether a constant is searched.

    """

    smallest_p: FloatArray
    between: tuple[float, float] = (1.0, 1.0)

    @property
    def least(self) -> float:
        """What `adjust` gives for p smaller than all simulated: a bound, the value is at most that."""
        return float(self.adjust(0.0))

    @cached_property
    def critical(self) -> float:
        """The largest p that is significant; anything above it need not be looked at again."""
        return float(self.smallest_p[np.searchsorted(self.adjust(self.smallest_p), ALPHA, side="right") - 1])

    def adjust(self, p: FloatArray | float) -> FloatArray:
        """Probability that the best of the family looks at least as good by chance; significant below `ALPHA`."""
        rank = np.searchsorted(self.smallest_p, p, side="right")
        return np.asarray(np.minimum((1.0 + rank) / (1.0 + self.smallest_p.size) / (1.0 - COUNTED), 1.0))
