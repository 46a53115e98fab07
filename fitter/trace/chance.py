"""Probability that chance looks as good as the best candidate: rate of false alarms, and adjustment of p."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rig.fitter.arrays import FloatArray

ALPHA = 0.035


COUNTED = 1 / 7
"""Share of ALPHA for tests that are counted one by one."""


def counted(p: float, sensors: int) -> float:
    """Family-wise p of such a test, which each sensor of a run has."""
    return min(p * sensors / COUNTED, 1.0)


DRAWS = 20_000


@dataclass(frozen=True, eq=False)
class Family:
    """Distribution of the family's smallest p by chance.

    Attributes:
        smallest_p: smallest p in `DRAWS` simulated runs without missing effects, ascending.
    """

    smallest_p: FloatArray

    @property
    def least(self) -> float:
        """Result of `adjust` for p below all simulated ones: an upper bound."""
        return float(self.adjust(0.0))

    def adjust(self, p: FloatArray | float) -> FloatArray:
        """Probability that the best of the family looks at least as good by chance; significant below `ALPHA`."""
        rank = np.searchsorted(self.smallest_p, p, side="right")
        return np.asarray(np.minimum((1.0 + rank) / (1.0 + self.smallest_p.size) / (1.0 - COUNTED), 1.0))
