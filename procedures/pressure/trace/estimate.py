"""The coefficients of the effects found, and the declared model of every transducer beside them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.split_plot import SplitPlotDesign, SplitPlotFit
from rig.fitter.trace.engine.beside import Coefficient, Level
from rig.fitter.trace.keep import LeftIn, left_in, taken_out
from rig.procedures.pressure.trace.judge import WholePlotJudge
from rig.procedures.pressure.trace.problem import Problem


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
        left_in: of each transducer, candidates that its outputs keep; () where all are taken out of all.
        within: of each transducer, candidates whose part between whole plots is left to the error of whole plots in
            `fits`; () for none.
    """

    chosen: tuple[int, ...]
    coefficients: Mapping[int, Coefficient]
    contribution: FloatArray
    declared: FloatArray
    fits: tuple[SplitPlotFit, ...]
    residual: FloatArray
    left_in: tuple[LeftIn, ...] = ()
    within: tuple[LeftIn, ...] = ()

    @property
    def taken(self) -> FloatArray:
        """(S, q) one where a candidate is taken out of a transducer's output, else zero."""
        return taken_out(self.chosen, self.left_in, len(self.fits))


def estimate(
    judge: WholePlotJudge, chosen: tuple[int, ...], outside: Sequence[LeftIn] = (), within: Sequence[LeftIn] = ()
) -> Estimate:
    """Fit the `chosen` candidates and the declared model; those `outside` are left in. Known fits are used again."""
    key = chosen, tuple(outside), tuple(within)
    if key not in judge.estimates:
        judge.estimates[key] = estimated(judge.problem, judge.coefficients(chosen), outside, within)
    found: Estimate = judge.estimates[key]
    return found


def estimated(
    problem: Problem,
    coefficients: Mapping[int, Coefficient],
    outside: Sequence[LeftIn] = (),
    within: Sequence[LeftIn] = (),
) -> Estimate:
    """The same with known coefficients of the candidates."""
    chosen = tuple(coefficients)
    contribution = contributed(problem, coefficients, taken=taken_out(chosen, outside, len(problem.sensors)))
    fits, residual = [], np.empty_like(problem.outputs)
    plain = design_of(problem, np.empty((len(problem.declared), 0)), ())
    declared = np.stack([plain.fit(left).coefficients for left in problem.outputs - contribution])
    for i, sensor in enumerate(problem.sensors):
        stays = outside[i] if outside else frozenset[int]()
        own = [j for j in chosen if problem.candidates[j].sensor == sensor and j not in stays]
        names = tuple(f"{problem.candidates[j].effect.name}: {problem.candidates[j].term.name}" for j in own)
        columns = problem.raw[i][:, own]
        of_line = contribution[i] - columns @ np.array([coefficients[j].value for j in own])
        if within and within[i]:
            inside = [j for j in chosen if j in within[i] and j not in stays]
            line = [j for j in inside if j not in own]
            means = _whole_plot_means(problem, problem.raw[i])
            of_line = of_line - means[:, line] @ np.array([coefficients[j].value for j in line])
            columns = columns - np.where([j in inside for j in own], means[:, own], 0.0)
        fits.append(design_of(problem, columns, names).fit(problem.outputs[i] - of_line))
        residual[i] = fits[-1].marginal_residuals
    return Estimate(chosen, coefficients, contribution, declared, tuple(fits), residual, tuple(outside), tuple(within))


def design_of(problem: Problem, columns: FloatArray, names: tuple[str, ...]) -> SplitPlotDesign:
    """The declared model with further columns (n, q); of the same columns it is made once."""
    key = names, columns.tobytes()
    if key not in problem.designs:
        problem.designs[key] = SplitPlotDesign(
            np.column_stack([problem.declared, columns]),
            problem.whole_plot,
            (*problem.names, *names),
            replicate=problem.replicate if problem.replicate.max() > 0 else None,
        )
    return problem.designs[key]


def error_of(fitted: Estimate, level: Level, i: int) -> tuple[float, float]:
    """The declared error of transducer `i` at a level, mV; if both are zero between whole plots, that within
    decides.
    """
    fit = fitted.fits[i]
    return (fit.sigma_subplot if level == "subplot" else fit.sigma_wholeplot, fit.sigma_subplot)


def residual_of(problem: Problem, fitted: Estimate) -> FloatArray:
    """(S, n) outputs minus the fit for any readings, including whole-plot errors, mV."""
    left = problem.outputs - contributed(problem, fitted.coefficients, taken=fitted.taken)
    return np.asarray(left - fitted.declared @ problem.declared.T)


def _whole_plot_means(problem: Problem, columns: FloatArray) -> FloatArray:
    """(n, m) mean of each column over the whole plot of each row."""
    design = np.zeros((int(problem.whole_plot.max()) + 1, columns.shape[1]))
    np.add.at(design, problem.whole_plot, columns)
    rows = np.maximum(np.bincount(problem.whole_plot), 1)
    return np.asarray((design / rows[:, None])[problem.whole_plot])


def never_above(judge: WholePlotJudge, before: Estimate, after: Estimate) -> Estimate:
    """The same effects, so that no transducer's error of all strata is above that before.

    An effect within whole plots also moves their means, where it may meet errors that happen to be against it. If it
    raises the error, its part between whole plots is left to that of whole plots; if this does not help, the whole
    effect is left in the transducer's output.
    """
    problem, found = judge.problem, after.chosen
    if np.all(stated(after) <= stated(before)):
        return after
    plots = tuple(j for j in found if problem.judged_at[j] == "subplot" and not problem.candidates[j].effect.of_noise)
    error = stated(before)
    within = left_in(judge, plots, problem.sensors, error, lambda one: stated(estimate(judge, found, within=one)))
    inside = left_in(judge, found, problem.sensors, error, lambda one: stated(estimate(judge, found, one, within)))
    return estimate(judge, found, inside, within)


def stated(fitted: Estimate) -> FloatArray:
    """(S,) error of all strata of each transducer, mV."""
    return np.array([float(np.hypot(fit.sigma_subplot, fit.sigma_wholeplot)) for fit in fitted.fits])


def contributed(
    problem: Problem,
    coefficients: Mapping[int, Coefficient],
    rows: IntArray | None = None,
    taken: FloatArray | None = None,
) -> FloatArray:
    """(S, n) contribution of the candidates with `coefficients` to the outputs (of some `rows`), mV.

    Args:
        problem: the run.
        coefficients: of the q candidates.
        rows: of the run; None for all.
        taken: (S, q) zero where a candidate stays in a transducer's outputs; None for nowhere.
    """
    raw = (problem.raw if rows is None else problem.raw[:, rows])[:, :, list(coefficients)]
    values = np.array([c.value for c in coefficients.values()])
    if taken is None or np.all(taken == 1.0):
        return np.asarray(raw @ values)
    return np.asarray(np.einsum("snq,sq->sn", raw, taken * values))
