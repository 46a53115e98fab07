"""Test of a steady drift of a parameter."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import special

from rig.fitter import ties
from rig.fitter.history.between_calibrations import Between, fit
from rig.fitter.history.likely_variances import draw
from rig.fitter.history.series import Series
from rig.fitter.quantiles import t_limit, t_tail

FEWEST = 3


@dataclass(frozen=True)
class Trend:
    """A straight line in time, with variation between calibrations.

    Attributes:
        per_year: slope, in the parameter's unit.
        stderr: its standard error, with the scatter between calibrations.
        df: degrees of freedom, m - 2.
        p: probability of such a slope or a steeper one for calibrations that only scatter. Exact for equal variances.
        p_walk: the same for a random walk: small if the movement is too steady for one, and so will continue.
        explained: share of the sum of squares about the mean explained by the line, weighted as for `step`.
        favoured: kind of variation with the higher likelihood.
    """

    per_year: float
    stderr: float
    df: int
    p: float
    p_walk: float
    explained: float
    favoured: Between

    @property
    def half_width_95(self) -> float:
        """Half-width of the 95 % interval of the slope."""
        return t_limit(0.95, self.df) * self.stderr


def trend(series: Series) -> Trend | None:
    """Fit a line; None for fewer than three calibrations."""
    if len(series) < FEWEST:
        return None
    fits = {between: fit(series, series.line, between) for between in Between}
    found = fits[Between.SCATTER]
    slope, stderr = float(found.coefficients[1]), float(np.sqrt(found.covariance[1, 1]))
    return Trend(
        per_year=slope,
        stderr=stderr,
        df=found.df,
        p=t_tail(slope / stderr, found.df) if stderr > 0 else float(slope == 0),
        p_walk=_p_walk(series),
        explained=_explained(series),
        favoured=ties.least(Between, key=lambda between: -fits[between].loglik, unit=1.0),
    )


def _p_walk(series: Series) -> float:
    drawn = draw(series, Between.WALK)
    below = float(np.mean(special.ndtr(-drawn.lines[:, 1] / np.sqrt(drawn.covariance[:, 1, 1]))))
    return 2.0 * min(below, 1.0 - below)


def _explained(series: Series) -> float:
    """Squared correlation with time; weights as for `step`, for comparison."""
    weights = 1.0 / (series.variance + fit(series, series.constant, Between.SCATTER).psi)
    y, t = (v - np.average(v, weights=weights) for v in (series.values, series.years))
    total = float(np.sum(weights * y**2) * np.sum(weights * t**2))
    return float(np.sum(weights * y * t)) ** 2 / total if total > 0 else 0.0
