"""The coefficients of the effects found, and the declared model of every transducer beside them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fitter.arrays import FloatArray, IntArray
from fitter.quantiles import t_limit
from fitter.split_plot import SplitPlotDesign, SplitPlotFit
from procedures.pressure.trace.problem import Problem
from procedures.pressure.trace.score import score
from procedures.pressure.trace.strata import Level


@dataclass(frozen=True)
class Coefficient:
    """Estimate of one candidate beside the others, from its stratum, in its own unit."""

    value: float
    stderr: float
    df: float

    @property
    def half_width_95(self) -> float:
        """Half-width of its 95 % interval."""
        return t_limit(0.95, self.df) * self.stderr


@dataclass(frozen=True, eq=False)
class Estimate:
    """Declared model and effects.

    Attributes:
        chosen: indices of the candidates in the model.
        coefficients: of each of them.
        contribution: (S, n) their contribution to the outputs, mV.
        declared: (S, k) coefficients of the declared model for the outputs minus that contribution: the effects may
            have other weights than in `fits`, and consistent values must come from one fit.
        fits: of the declared model and the effects together, by restricted maximum likelihood: errors and variances.
        residual: (S, n) outputs minus all of these, including whole-plot errors, mV.
    """

    chosen: tuple[int, ...]
    coefficients: Mapping[int, Coefficient]
    contribution: FloatArray
    declared: FloatArray
    fits: tuple[SplitPlotFit, ...]
    residual: FloatArray


def estimate(problem: Problem, chosen: tuple[int, ...]) -> Estimate:
    """Fit the `chosen` candidates and the declared model."""
    coefficients = coefficients_of(problem, chosen)
    contribution = contributed(problem, coefficients)
    replicate = problem.replicate if problem.replicate.max() > 0 else None
    fits, residual = [], np.empty_like(problem.outputs)
    beside = SplitPlotDesign(problem.declared, problem.whole_plot, problem.names, replicate=replicate)
    declared = np.stack([beside.fit(left).coefficients for left in problem.outputs - contribution])
    for i, sensor in enumerate(problem.sensors):
        own = [j for j in chosen if problem.candidates[j].sensor == sensor]
        names = [f"{problem.candidates[j].effect.name}: {problem.candidates[j].term.name}" for j in own]
        of_line = contribution[i] - problem.raw[i][:, own] @ np.array([coefficients[j].value for j in own])
        design = SplitPlotDesign(
            np.column_stack([problem.declared, problem.raw[i][:, own]]),
            problem.whole_plot,
            (*problem.names, *names),
            replicate=replicate,
        )
        fits.append(design.fit(problem.outputs[i] - of_line))
        residual[i] = fits[-1].marginal_residuals
    return Estimate(chosen, coefficients, contribution, declared, tuple(fits), residual)


def error_of(fitted: Estimate, level: Level, i: int) -> tuple[float, float]:
    """The declared error of transducer `i` at a level, mV; if both are zero between whole plots, that within
    decides.
    """
    fit = fitted.fits[i]
    return (fit.sigma_subplot if level == "subplot" else fit.sigma_wholeplot, fit.sigma_subplot)


def residual_of(problem: Problem, fitted: Estimate) -> FloatArray:
    """(S, n) outputs minus the fit for any readings, including whole-plot errors, mV."""
    left = problem.outputs - contributed(problem, fitted.coefficients)
    return np.asarray(left - fitted.declared @ problem.declared.T)


def coefficients_of(problem: Problem, chosen: tuple[int, ...]) -> dict[int, Coefficient]:
    """Coefficients of the `chosen` candidates, each beside all others, with the error of its test."""
    found = {}
    for j in chosen:
        scores = score(problem, tuple(k for k in chosen if k != j), (j,))
        gamma, t = float(scores.gamma[j]), float(scores.t[j])
        found[j] = Coefficient(gamma, abs(gamma / t) if t else 0.0, float(scores.df[j]))
    return found


def contributed(problem: Problem, coefficients: Mapping[int, Coefficient], rows: IntArray | None = None) -> FloatArray:
    """(S, n) contribution of the candidates with `coefficients` to the outputs (of some `rows`), mV."""
    raw = problem.raw if rows is None else problem.raw[:, rows]
    return np.asarray(raw[:, :, list(coefficients)] @ np.array([c.value for c in coefficients.values()]))
