"""One parameter of a sensor over several calibrations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.checked import finite
from rig.fitter.errors import FitError


@dataclass(frozen=True, eq=False)
class Series:
    """Values of one parameter, in order of time.

    Attributes:
        years: (m,) times, in years of 365.25 days since the first.
        values: (m,) in the parameter's unit.
        variance: (m,) of each value's error within its calibration, squared unit.
        df: degrees of freedom of `variance`, which all calibrations share.

    Raises:
        FitError: fewer than two calibrations, times that do not ascend, or a variance that is not positive.
    """

    years: FloatArray
    values: FloatArray
    variance: FloatArray
    df: float

    def __post_init__(self) -> None:
        count = np.size(self.values)
        if count < 2:
            raise FitError("a chart needs at least two calibrations")
        for name in ("years", "values", "variance"):
            object.__setattr__(self, name, finite(name, getattr(self, name), count))
        if not np.all(np.diff(self.years) > 0):
            raise FitError("the calibrations are not in order of time, or two are of the same time")
        if not (np.all(self.variance > 0) and self.df > 0):
            raise FitError("the calibrations leave no degrees of freedom for their own error")

    def __len__(self) -> int:
        return len(self.values)

    @property
    def line(self) -> FloatArray:
        """(m, 2) columns of a straight line in time."""
        return np.column_stack([np.ones(len(self)), self.years])

    @property
    def constant(self) -> FloatArray:
        """(m, 1) column of a constant."""
        return np.ones((len(self), 1))
