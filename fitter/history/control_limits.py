"""The control chart of one parameter: centre line and limits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rig.fitter.arrays import FloatArray
from rig.fitter.history.between_calibrations import Between, fit
from rig.fitter.history.series import Series
from rig.fitter.quantiles import t_limit

FEWEST = 3
WARNING, ACTION = 0.95, 0.997


@dataclass(frozen=True, eq=False)
class Limits:
    """Centre line and limits of each calibration.

    Attributes:
        centre: weighted mean of all calibrations.
        warning: (m,) half-width that a calibration exceeds with 5 % probability if nothing changed.
        action: (m,) the same with 0.3 %.
        deviation: (m,) value minus centre.
    """

    centre: float
    warning: FloatArray
    action: FloatArray
    deviation: FloatArray

    @property
    def warned(self) -> NDArray[np.bool_]:
        """(m,) outside the warning limits."""
        return np.abs(self.deviation) > self.warning

    @property
    def out(self) -> NDArray[np.bool_]:
        """(m,) outside the action limits."""
        return np.abs(self.deviation) > self.action


def limits(series: Series) -> Limits | None:
    """Chart a series; None for fewer than three calibrations.

    A calibration is judged by its distance from the mean of the others, in Student's t on m - 2 degrees of freedom with
    the variance within and between the others. On the chart, whose centre includes the calibration itself, this is
    Thompson's limit, t sqrt(m - 1) / sqrt(m - 2 + t^2) standard deviations of the residual. If the calibrations differ
    by less than their own error, by chance, that error counts.
    """
    m = len(series)
    if m < FEWEST:
        return None
    found = fit(series, series.constant, Between.SCATTER)
    total = series.variance + found.psi
    unscaled = 1.0 / np.sum(1.0 / total)
    scale = float(found.covariance[0, 0] / unscaled)
    sd = np.sqrt(scale * (total - unscaled))
    own = np.sqrt(np.maximum(series.variance - 1.0 / np.sum(1.0 / series.variance), 0.0))
    warning, action = (
        np.maximum(sd * _thompson(level, m), own * t_limit(level, series.df)) for level in (WARNING, ACTION)
    )
    deviation = series.values - found.coefficients[0]
    return Limits(float(found.coefficients[0]), warning, action, deviation)


def _thompson(level: float, m: int) -> float:
    """Limit of a residual over its standard deviation (W. R. Thompson, Ann. Math. Statist. 6, 214, 1935)."""
    t = t_limit(level, m - 2)
    return float(t * np.sqrt(m - 1) / np.sqrt(m - 2 + t**2))
