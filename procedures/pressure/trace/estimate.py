"""The coefficients of the effects found, and the declared model of every transducer beside them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.split_plot import SplitPlotDesign, SplitPlotFit
from rig.fitter.trace.engine.beside import Coefficient, Level
from rig.fitter.trace.keep import SAME
from rig.procedures.pressure.trace.judge import WholePlotJudge
from rig.procedures.pressure.trace.problem import Problem


@dataclass(frozen=True, eq=False)
class Estimate:
    """Declared model and effects.

    Attributes:
        chosen: indices of the candidates in the model.
        coefficients: of each of them.
        declared: (S, k) coefficients of the declared model for the outputs minus the effects, which may have other
            weights than in `fits`: consistent values must come from one fit.
        fits: of the declared model and the effects together, by restricted maximum likelihood: errors and variances.
        residual: (S, n) outputs minus all of these, including whole-plot errors, mV.
    """

    chosen: tuple[int, ...]
    coefficients: Mapping[int, Coefficient]
    declared: FloatArray
    fits: tuple[SplitPlotFit, ...]
    residual: FloatArray


def estimate(judge: WholePlotJudge, chosen: tuple[int, ...], beside: tuple[int, ...] | None = None) -> Estimate:
    """Fit the `chosen` candidates and the declared model. Known fits are used again.

    Args:
        judge: of the run.
        chosen: candidates in the model.
        beside: candidates beside which a reading stands alone and counts as three standard deviations; those chosen by
            default.
    """
    key = chosen, chosen if beside is None else beside
    if key not in judge.estimates:
        judge.estimates[key] = _estimated(judge.problem, judge.held(key[1]), judge.coefficients(chosen))
    found: Estimate = judge.estimates[key]
    return found


def _estimated(problem: Problem, outputs: FloatArray, coefficients: Mapping[int, Coefficient]) -> Estimate:
    contribution = contributed(problem, coefficients)
    plain = design_of(problem, np.empty((len(problem.declared), 0)), ())
    declared = np.stack([plain.fit(left).coefficients for left in outputs - contribution])
    fits = tuple(_fit(problem, y, coefficients, i, problem.raw[i]) for i, y in enumerate(outputs))
    residual = problem.outputs - contribution - declared @ problem.declared.T
    return Estimate(tuple(coefficients), coefficients, declared, fits, residual)


def _fit(
    problem: Problem, y: FloatArray, coefficients: Mapping[int, Coefficient], i: int, raw: FloatArray
) -> SplitPlotFit:
    """The declared model and the own effects of transducer `i`, with columns (n, J); those of the line are known."""
    own = [j for j in coefficients if problem.candidates[j].sensor == problem.sensors[i]]
    names = tuple(f"{problem.candidates[j].effect.name}: {problem.candidates[j].term.name}" for j in own)
    line = [j for j in coefficients if j not in own]
    of_line = raw[:, line] @ np.array([coefficients[j].value for j in line])
    return design_of(problem, raw[:, own], names).fit(y - of_line)


def left_to_plots(judge: WholePlotJudge, before: Estimate, after: Estimate) -> Estimate:
    """The same effects; where a transducer's error of all strata rises, with less of them.

    An effect within whole plots also moves their means, where it may meet errors that happen to be against it: the
    parts between whole plots of such effects are left to their error then. What is left may still rise: see `rises`.
    """
    problem, fits = judge.problem, list(after.fits)
    index, inside = problem.whole_plot, [level == "subplot" for level in problem.judged_at]
    for i, y in enumerate(judge.held(after.chosen)):
        if rises(before, after, i):
            sums = np.zeros((int(index.max()) + 1, len(inside)))
            np.add.at(sums, index, problem.raw[i])
            means = (sums / np.bincount(index)[:, None])[index]
            fits[i] = _fit(problem, y, after.coefficients, i, problem.raw[i] - np.where(inside, means, 0.0))
    return replace(after, fits=tuple(fits))


def rises(before: Estimate, after: Estimate, i: int) -> bool:
    """Whether the error of all strata of transducer `i` is above that before."""
    old, new = (float(np.hypot(one.fits[i].sigma_subplot, one.fits[i].sigma_wholeplot)) for one in (before, after))
    return new > old * (1.0 + SAME)


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


def contributed(problem: Problem, coefficients: Mapping[int, Coefficient], rows: IntArray | None = None) -> FloatArray:
    """(S, n) contribution of the candidates with `coefficients` to the outputs (of some `rows`), mV."""
    raw = (problem.raw if rows is None else problem.raw[:, rows])[:, :, list(coefficients)]
    return np.asarray(raw @ np.array([c.value for c in coefficients.values()]))
