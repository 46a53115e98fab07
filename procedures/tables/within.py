"""Scatter of the readings inside the points of a run: what the mean of another number of them scatters by.

A row of a run is the mean of the readings of its point. The scatter of rows has that of the readings in it, divided by
their number, and what readings of one point share. Only the first part depends on the number.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

KEY = "readings"
"""Key of calibration files."""


@dataclass(frozen=True)
class Within:
    """Readings of an output inside the points of a run.

    Attributes:
        readings: of a point; the harmonic mean, where points have different numbers of them.
        sd: standard deviation of one of them inside its point, in the output's unit; 0 without degrees of freedom.
        df: degrees of freedom of `sd`, sum of all numbers less one.
    """

    readings: float
    sd: float
    df: float

    @classmethod
    def of(cls, sds: Sequence[float], counts: Sequence[float]) -> Within | None:
        """Pooled from (n,) standard deviations of one reading and numbers of readings; None if one is not known."""
        sd, n = np.asarray(sds, np.float64), np.asarray(counts, np.float64)
        if not len(n) or not (np.isfinite(sd) & np.isfinite(n) & (n >= 1.0)).all():
            return None
        df = float(np.sum(n - 1.0))
        variance = float(np.sum((n - 1.0) * sd**2)) / df if df else 0.0
        return cls(float(1.0 / np.mean(1.0 / n)), variance**0.5, df)

    def change(self, variance: float, count: float) -> float:
        """Change of the variance of a row for one that is the mean of `count` readings.

        What is left is not below the variance of that mean, which a variance found small by chance would allow.

        Args:
            variance: of a row about the others of its whole plot.
            count: number of readings.
        """
        own = self.sd**2
        return max(own / count - own / self.readings, own / count - variance)

    def to_dict(self) -> dict[str, float]:
        """JSON values."""
        return {"readings": self.readings, "sd": self.sd, "df": self.df}

    @classmethod
    def from_dict(cls, given: Mapping[str, Any]) -> Within:
        """Restore from `to_dict`. Raises `ValueError` for numbers that cannot be, and errors of indexing."""
        found = cls(float(given["readings"]), float(given["sd"]), float(given["df"]))
        if not (found.readings >= 1.0 and found.sd >= 0.0 and found.df >= 0.0):
            raise ValueError("the readings of its points are no numbers of readings and no scatter")
        return found
