"""Error of the last calibration over its age.

Given the variances, the value of one parameter at a later time has a normal distribution: the best linear unbiased
prediction from a straight line and the variation between calibrations (universal kriging), minus the value of the last
calibration. The variances are drawn from their uncertainty (`rig.fitter.history.likely_variances`).

The errors of all parameters give the error of the output, and its largest value over the range of use. Parameters may
move independently, or together by one cause. Independent draws give the first bound. For the second, the output itself
is predicted at places where parameters that move together have the largest effect; its values contain their
correlation. The larger bound counts.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from itertools import product

import numpy as np
from scipy import special

from rig.fitter import ties
from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.history.between_calibrations import Between
from rig.fitter.history.charted import Charted
from rig.fitter.history.likely_variances import NODES, draw
from rig.fitter.history.series import Series

FEWEST = 3
DRAWS = 16384
TIMES = 25
_LEVEL = 0.95
"""Probability that a bound holds, everywhere at once."""
_SEED = 2


@dataclass(frozen=True, eq=False)
class ErrorBound:
    """Bound on the error of the last calibration's output over its age.

    Attributes:
        years: (T,) age of the last calibration, from 0; at most the length of the history.
        bounds: (T,) by kind of variation, in the unit of the output: with the requested probability the error stays
            below it everywhere in the range of use.
    """

    years: FloatArray
    bounds: Mapping[Between, FloatArray]

    def holds_for(self, tolerance: float, between: Between | None = None) -> float | None:
        """Years until a bound first exceeds `tolerance`: the earliest of all kinds, or of one; None if it does at once.

        The last of `years` if it never does: later times are not forecast.
        """
        if between is None:
            each = [self.holds_for(tolerance, kind) for kind in self.bounds]
            known = [years for years in each if years is not None]
            return min(known) if len(known) == len(each) else None
        bound = self.bounds[between]
        over = np.flatnonzero(bound > tolerance)
        if not over.size:
            return float(self.years[-1])
        at = int(over[0])
        if at == 0:
            return None
        share = (tolerance - bound[at - 1]) / (bound[at] - bound[at - 1])
        return float(self.years[at - 1] + share * (self.years[at] - self.years[at - 1]))

    def governs(self, tolerance: float) -> Between:
        """The kind of variation whose bound reaches `tolerance` first."""
        return ties.least(self.bounds, key=lambda kind: self.holds_for(tolerance, kind) or -1.0)


@dataclass(frozen=True, eq=False)
class Prediction:
    """Error of the last calibration in one parameter.

    Attributes:
        mean: (n, T) value at that age minus the value of the last calibration, for n draws of the variances.
        sd: (n, T).
    """

    mean: FloatArray
    sd: FloatArray

    def bound(self, level: float) -> FloatArray:
        """(T,) two-sided limit of the error with this probability."""
        low, high = np.zeros(self.mean.shape[1]), np.max(np.abs(self.mean) + 10.0 * self.sd, axis=0)
        sd = np.maximum(self.sd, np.finfo(float).tiny)
        for _ in range(24):
            middle = 0.5 * (low + high)
            inside = special.ndtr((middle - self.mean) / sd) - special.ndtr((-middle - self.mean) / sd)
            below = inside.mean(axis=0) < level
            low, high = np.where(below, middle, low), np.where(below, high, middle)
        return np.asarray(0.5 * (low + high))


def error_bound(
    charted: Charted,
    rows: FloatArray,
    *,
    times: int = TIMES,
    draws: int = DRAWS,
    nodes: int = NODES,
) -> ErrorBound | None:
    """Bound the error of the last calibration's output; None for fewer than three calibrations.

    Args:
        charted: q parameters of the sensor.
        rows: (H, q) derivative of the output by each parameter, at H places of the range of use.
        times: number of ages.
        draws: number of draws of the errors; the bound has a standard error of half a percent.
        nodes: number of draws of the variances of each parameter.
    """
    years = charted.series[0].years
    if len(years) < FEWEST:
        return None
    ages = (years[-1] - years[0]) * np.linspace(0.0, 1.0, times) ** 2  # dense where bounds are curved
    outputs = [charted.combined(row) for row in _worst_together(charted, rows)]
    node, normal = _dice(len(charted.series), draws, nodes)
    bounds = {}
    for between in Between:
        predictions = [predict(one, between, ages, nodes) for one in charted.series]
        bound = np.empty(times)
        for t in range(times):
            parts = zip(predictions, node, normal, strict=True)
            errors = np.stack([p.mean[drawn, t] + p.sd[drawn, t] * z for p, drawn, z in parts])
            at = rows @ errors
            bound[t] = np.quantile(np.maximum(at.max(axis=0), -at.min(axis=0)), _LEVEL)
        together = [predict(one, between, ages, nodes).bound(_LEVEL) for one in outputs]
        bounds[between] = np.max([bound, *together], axis=0)
    return ErrorBound(ages, bounds)


def _worst_together(charted: Charted, rows: FloatArray) -> FloatArray:
    """(h, q) the rows with the largest effect of parameters that move together, in any combination of signs."""
    reach = np.array([np.sqrt(np.var(s.values) + np.mean(s.variance)) for s in charted.series])
    sides = np.array([(1.0, *rest) for rest in product((1.0, -1.0), repeat=len(reach) - 1)])
    return np.asarray(rows[np.unique(ties.highest_of_each(np.abs((rows * reach) @ sides.T), 0.0))])


def predict(series: Series, between: Between, ages: FloatArray, nodes: int = NODES) -> Prediction:
    """The error of the last calibration in one parameter at (T,) ages, in years."""
    drawn, x = draw(series, between, nodes), series.line
    later = series.years[-1] + ages
    there = np.column_stack([np.ones_like(later), later])
    shared = drawn.psi[:, None, None] * between.with_later(series.years, later)
    kriging = shared @ drawn.inverse
    residual = series.values - drawn.lines @ x.T
    mean = drawn.lines @ there.T + np.einsum("ntm,nm->nt", kriging, residual)
    left = there - kriging @ x
    variance = (
        drawn.psi[:, None] * between.of_later(series.years, later)
        - np.einsum("ntm,ntm->nt", kriging, shared)
        + np.einsum("ntp,npq,ntq->nt", left, drawn.covariance, left)
    )
    return Prediction(mean - series.values[-1], np.sqrt(np.maximum(variance, 0.0)))


@lru_cache(maxsize=8)
def _dice(parameters: int, draws: int, nodes: int) -> tuple[IntArray, FloatArray]:
    """(q, draws) index of the draw of variances and (q, draws) standard normal numbers, evenly spread; always
    the same.
    """
    rng = np.random.default_rng(_SEED)
    node = np.stack([rng.permutation(np.arange(draws) % nodes) for _ in range(parameters)])
    normal = special.ndtri((np.arange(draws) + 0.5) / draws)
    return node, np.stack([rng.permutation(normal) for _ in range(parameters)])
