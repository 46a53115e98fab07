"""Errors of a pressure calibration: whole plot, replication, and a subplot error that may grow with pressure.

The covariance of the readings is V = D + s_w^2 Z Z' (+ s_r^2 R R'), D diagonal, and the subplot error has

    standard deviation s(P) = s_0 (1 + c P), that is a + b P with a = s_0 and b = s_0 c.

c is zero unless a one-sided score test on the restricted likelihood rejects that at 1 %; then all parameters are
estimated together by Fisher scoring. A method's covariance is A V A' for its estimator A y, independent of the method's
assumptions, and its degrees of freedom follow from the covariance of the parameters (Satterthwaite).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy import special

from rig.fitter.arrays import FloatArray
from rig.fitter.split_plot import SplitPlotFit
from rig.procedures.pressure.data import WholePlotData

GROWTH_LEVEL = 0.01
"""Probability of a false detection of growth with pressure."""

MOST_GROWTH = 99.0
"""Maximum of c times the highest pressure: the subplot error at zero pressure is at least 1 % of that at the
highest.
"""

_ITERATIONS, _HALVINGS, _CONVERGED = 60, 30, 1e-7


@dataclass(frozen=True, eq=False)
class Errors:
    """Parameters in the order variance of the subplot at zero pressure, growth, whole plot, replication.

    Attributes:
        subplot_variance: s_0^2, mV^2.
        growth_per_psia: c.
        wholeplot_variance: mV^2.
        replicate_variance: mV^2; None if replications are not nested.
        spread: (p, p) covariance of the parameters; rows of those fixed at zero are zero. p is 4.
        p_growth: probability of such evidence of growth by chance.
    """

    subplot_variance: float
    growth_per_psia: float
    wholeplot_variance: float
    replicate_variance: float | None
    spread: FloatArray
    p_growth: float

    def subplot_sd(self, pressure_psia: FloatArray) -> FloatArray:
        """(n,) standard deviation of a reading within its whole plot, mV."""
        return np.asarray(np.sqrt(self.subplot_variance) * np.abs(1.0 + self.growth_per_psia * pressure_psia))

    @property
    def between_variance(self) -> float:
        """Variance of the common error of a new whole plot, mV^2."""
        return self.wholeplot_variance + (self.replicate_variance or 0.0)

    def to_dict(self) -> dict[str, Any]:
        """JSON values; `from_dict` restores the same object."""
        return {
            "subplot_variance": self.subplot_variance,
            "growth_per_psia": self.growth_per_psia,
            "wholeplot_variance": self.wholeplot_variance,
            "replicate_variance": self.replicate_variance,
            "spread": self.spread.tolist(),
            "p_growth": self.p_growth,
        }

    @staticmethod
    def from_dict(given: Mapping[str, Any]) -> Errors:
        """Restore from `to_dict`."""
        replicate = given["replicate_variance"]
        return Errors(
            subplot_variance=float(given["subplot_variance"]),
            growth_per_psia=float(given["growth_per_psia"]),
            wholeplot_variance=float(given["wholeplot_variance"]),
            replicate_variance=None if replicate is None else float(replicate),
            spread=np.array(given["spread"], np.float64),
            p_growth=float(given["p_growth"]),
        )

    def of_reading(self, pressure_psia: FloatArray, *, new_whole_plot: bool) -> tuple[FloatArray, FloatArray]:
        """Variance (n,) of the error of one new reading, mV^2, and its gradient (n, p) by the parameters."""
        grown = 1.0 + self.growth_per_psia * pressure_psia
        shared = np.full(len(grown), float(new_whole_plot))
        nested = shared if self.replicate_variance is not None else 0.0 * shared
        by_growth = 2.0 * self.subplot_variance * pressure_psia * grown
        gradient = np.column_stack([grown**2, by_growth, shared, nested])
        return self.subplot_variance * grown**2 + shared * self.between_variance, gradient

    def of_whole_plots(self, count: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Variance (n,) of the errors of (n,) numbers of new whole plots, mV^2, and its gradient (n, p)."""
        nested = count if self.replicate_variance is not None else 0.0 * count
        nothing = 0.0 * count
        return count * self.between_variance, np.column_stack([nothing, nothing, count, nested])

    def df(self, variance: FloatArray, gradient: FloatArray) -> FloatArray:
        """(n,) degrees of freedom of (n,) variances with these (n, p) gradients."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(2.0 * variance**2 / np.einsum("ni,ij,nj->n", gradient, self.spread, gradient))


@dataclass(frozen=True, eq=False)
class Layout:
    """Grouping of readings with common errors.

    Attributes:
        pressure_psia: (n,).
        wholeplot: (n, W) indicators.
        replicate: (n, R) indicators; None if replications are not nested.
    """

    pressure_psia: FloatArray
    wholeplot: FloatArray
    replicate: FloatArray | None

    @staticmethod
    def of(data: WholePlotData, *, nested: bool) -> Layout:
        """Layout of these observations."""
        replicates, index = np.unique(data.replicate, return_inverse=True)
        return Layout(
            data.pressure_psia,
            np.eye(len(data.whole_plots))[data.whole_plot_index],
            np.eye(len(replicates))[index] if nested else None,
        )

    def solve(self, errors: Errors, right: FloatArray) -> FloatArray:
        """V^-1 times (n, m) `right`, by the matrix inversion lemma."""
        d, weighted, inner = self._factors(errors)
        return np.asarray(right / d - weighted @ np.linalg.solve(inner, weighted.T @ right))

    def loglik(self, errors: Errors, columns: FloatArray, y: FloatArray) -> float:
        """Restricted log-likelihood of `errors`, except for a constant that depends on `columns`."""
        d, _, inner = self._factors(errors)
        solved = self.solve(errors, columns)
        of_columns = columns.T @ solved
        r = y - columns @ np.linalg.solve(of_columns, solved.T @ y)
        log_det = np.sum(np.log(d)) + np.linalg.slogdet(inner)[1] + np.linalg.slogdet(of_columns)[1]
        return float(-0.5 * (log_det + r @ self.solve(errors, r[:, None])[:, 0]))

    def _factors(self, errors: Errors) -> tuple[FloatArray, FloatArray, FloatArray]:
        """With V = D + G G': the diagonal of D as a column, D^-1 G, and 1 + G' D^-1 G."""
        d = errors.subplot_sd(self.pressure_psia)[:, None] ** 2
        shared = np.sqrt(errors.wholeplot_variance) * self.wholeplot
        if self.replicate is not None:
            shared = np.column_stack([shared, np.sqrt(errors.replicate_variance or 0.0) * self.replicate])
        weighted = shared / d
        return d, weighted, np.eye(shared.shape[1]) + shared.T @ weighted

    def covariance(self, errors: Errors, estimator: FloatArray) -> tuple[FloatArray, FloatArray]:
        """A V A' (k, k) for a (k, n) estimator A, and its derivatives (p, k, k) by the parameters."""
        diagonal, shared = self._shapes(errors)
        of_readings = [(estimator * d) @ estimator.T for d in diagonal]
        of_shared = [(estimator @ z) @ (estimator @ z).T for z in shared]
        derivatives = np.stack(of_readings + of_shared)
        values = np.array([errors.subplot_variance, 0.0, errors.wholeplot_variance, errors.replicate_variance or 0.0])
        return np.einsum("p,pkl->kl", values, derivatives), derivatives

    def variances(self, errors: Errors, rows: FloatArray, *, shared: bool = True) -> tuple[FloatArray, FloatArray]:
        """(m,) diagonal of H V H' for (m, n) `rows` H, and its gradient (m, p); `shared` off leaves D alone in V."""
        diagonal, indicators = self._shapes(errors)
        of_readings = [rows**2 @ d for d in diagonal]
        of_shared = [float(shared) * np.sum((rows @ z) ** 2, axis=1) for z in indicators]
        gradient = np.column_stack(of_readings + of_shared)
        values = np.array([errors.subplot_variance, 0.0, errors.wholeplot_variance, errors.replicate_variance or 0.0])
        return gradient @ values, gradient

    def restricted(self, errors: Errors, columns: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(p,) score and (p, p) expected information of the restricted likelihood at `errors`."""
        solved = self.solve(errors, np.column_stack([np.eye(len(y)), columns]))
        inverse, vx = solved[:, : len(y)], solved[:, len(y) :]
        projector = inverse - vx @ np.linalg.solve(columns.T @ vx, vx.T)
        diagonal, shared = self._shapes(errors)
        halves = [projector @ z for z in shared]
        py = projector @ y
        score = [float((py**2 - np.diag(projector)) @ d) for d in diagonal]
        score += [float(np.sum((z.T @ py) ** 2) - np.sum(z * half)) for z, half in zip(shared, halves, strict=True)]
        squared = projector**2
        p = len(diagonal) + len(shared)
        information = np.zeros((p, p))
        for i, d in enumerate(diagonal):
            information[i, : len(diagonal)] = [d @ squared @ other for other in diagonal]
            information[i, len(diagonal) :] = [d @ np.sum(half**2, axis=1) for half in halves]
        for i, z in enumerate(shared, len(diagonal)):
            information[i, len(diagonal) :] = [np.sum((z.T @ half) ** 2) for half in halves]
        information = np.triu(information) + np.triu(information, 1).T
        return 0.5 * np.array(score), 0.5 * information

    def _shapes(self, errors: Errors) -> tuple[list[FloatArray], list[FloatArray]]:
        """Derivatives of V by the parameters: diagonals of the first two, factors of the others."""
        grown = 1.0 + errors.growth_per_psia * self.pressure_psia
        none = np.zeros((len(grown), 1))
        diagonal = [grown**2, 2.0 * errors.subplot_variance * self.pressure_psia * grown]
        return diagonal, [self.wholeplot, none if self.replicate is None else self.replicate]


def estimate_errors(fit: SplitPlotFit, columns: FloatArray, layout: Layout, *, growth: bool | None = None) -> Errors:
    """Errors of the readings behind `fit`.

    Args:
        fit: of the same readings, with one subplot variance.
        columns: (n, k) columns of the fit.
        layout: of the readings.
        growth: whether the subplot error grows with pressure; None to let the test decide.
    """
    v = fit.variances
    even = Errors(v.subplot, 0.0, v.wholeplot, v.replicate, np.zeros((4, 4)), float("nan"))
    unit = columns / np.linalg.norm(columns, axis=0)
    q = np.linalg.qr(unit)[0]
    score, information = layout.restricted(even, q, fit.y)
    free = [0, *(i for i, value in ((2, v.wholeplot), (3, v.replicate)) if value)]
    rest = np.linalg.solve(_block(information, free), information[free, 1])
    beyond = information[1, 1] - information[1, free] @ rest
    # the score of c is U_c; those of the other parameters are zero at their estimates
    p = float(special.ndtr(-score[1] / np.sqrt(beyond))) if beyond > 1e-9 * information[1, 1] else 1.0
    even = replace(even, p_growth=p, spread=_spread(information, free))
    if growth is False or (growth is None and not p < GROWTH_LEVEL):
        return even
    return _scored(even, layout, q, fit.y)


def _scored(start: Errors, layout: Layout, columns: FloatArray, y: FloatArray) -> Errors:
    """All parameters by Fisher scoring, with steps halved until the likelihood increases; parameters at a limit are
    fixed there.
    """
    highest = float(layout.pressure_psia.max())
    lowest = np.array([0.0, -0.9 / highest, 0.0, 0.0])
    greatest = np.array([np.inf, MOST_GROWTH / highest, np.inf, np.inf])
    here, there = start, layout.loglik(start, columns, y)
    free = [0, 1]
    for _ in range(_ITERATIONS):
        score, information = layout.restricted(here, columns, y)
        values = np.array(_values(here))
        at_limit = (values <= lowest) & (score <= 0) | (values >= greatest) & (score >= 0)
        free = [i for i in range(4) if not at_limit[i] and information[i, i] > 0]
        step = np.zeros(4)
        step[free] = _spread(information, free)[np.ix_(free, free)] @ score[free]
        for _ in range(_HALVINGS):
            trial = np.clip(values + step, lowest, greatest)
            trial[0] = max(trial[0], 0.1 * values[0])
            moved = _moved(here, trial)
            reached = layout.loglik(moved, columns, y)
            if reached >= there:
                break
            step *= 0.5
        else:
            break
        here, there = moved, reached
        if np.all(np.abs(trial - values) <= _CONVERGED * np.maximum(np.abs(trial), 1e-12)):
            break
    return replace(here, spread=_spread(layout.restricted(here, columns, y)[1], free))


def _moved(errors: Errors, values: FloatArray) -> Errors:
    nested = None if errors.replicate_variance is None else float(values[3])
    return replace(
        errors,
        subplot_variance=float(values[0]),
        growth_per_psia=float(values[1]),
        wholeplot_variance=float(values[2]),
        replicate_variance=nested,
    )


def _values(errors: Errors) -> tuple[float, float, float, float]:
    nested = errors.replicate_variance or 0.0
    return errors.subplot_variance, errors.growth_per_psia, errors.wholeplot_variance, nested


def _block(matrix: FloatArray, rows: list[int]) -> FloatArray:
    return np.asarray(matrix[np.ix_(rows, rows)])


def _spread(information: FloatArray, free: list[int]) -> FloatArray:
    """(p, p) inverse of the information on the free parameters, whose units differ widely; zero elsewhere."""
    block = _block(information, free)
    unit = np.sqrt(np.diag(block))
    spread = np.zeros_like(information)
    spread[np.ix_(free, free)] = np.linalg.inv(block / np.outer(unit, unit)) / np.outer(unit, unit)
    return spread
