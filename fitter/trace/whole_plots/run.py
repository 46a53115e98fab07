"""From the residual to the effect, for whole plots: the whole of a trace."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fitter.arrays import FloatArray
from fitter.effects import PRESSURE_CATALOGUE, PressureEffect, PressureScene
from fitter.linear import RankError
from fitter.pressure.models import HIERARCHICAL, check_determined, named_formula
from fitter.split_plot import SplitPlotDesign
from fitter.trace.family import Family
from fitter.trace.result import Explanation
from fitter.trace.search import prune, search_and_name
from fitter.trace.whole_plots.estimate import coefficients_of, contributed, estimate
from fitter.trace.whole_plots.judge import WholePlotJudge
from fitter.trace.whole_plots.noise import Noise
from fitter.trace.whole_plots.null import family_of
from fitter.trace.whole_plots.problem import Problem, pose
from fitter.trace.whole_plots.report import Finding, transducer
from fitter.trace.whole_plots.result import WholePlotTrace
from fitter.trace.whole_plots.weights import noises, stands_out, weighted
from fitter.whole_plot_data import WholePlotData

SEED = 20260115
ROUNDS = 3
FOLDS = 24
"""Times at most that whole plots are left out."""


def trace_whole_plots(
    data: WholePlotData,
    model: str = "full",
    catalogue: Sequence[PressureEffect] = PRESSURE_CATALOGUE,
    seed: int = SEED,
) -> WholePlotTrace:
    """Find what the declared model of pressure transducers lacks.

    Args:
        data: a whole-plot run; any number of transducers on one line, judged together.
        model: a name of `fitter.pressure.models`, or a formula; "hierarchical" is the full model, whose terms a
            search could only put back.
        catalogue: effects to look for.
        seed: of the simulated null; the same data and seed give the same answer.

    Raises:
        fitter.linear.RankError: the observations do not determine the declared model.
        fitter.formula.FormulaError: the model is neither a name nor a formula.
        ValueError: the observations do not determine the model's errors; the message says why.

    """
    formula = named_formula(model)
    names, declared = formula.columns(data.table)
    check_determined(data, formula)
    scene = scene_of(data)
    problem, family, found, noise = _settle(data, pose(data, names, declared, scene, catalogue), seed)
    before, after = estimate(replace(problem, weight=np.ones_like(problem.weight)), ()), estimate(problem, found)
    finding = Finding(
        data=data,
        model=model if model != HIERARCHICAL else f"full (where {HIERARCHICAL} starts)",
        formula=formula,
        scene=scene,
        judge=WholePlotJudge(problem, family),
        before=before,
        after=after,
        noise=noise,
        cv=left_out(problem, family, found),
    )
    sensors = {sensor: transducer(finding, i) for i, sensor in enumerate(problem.sensors)}
    chosen = tuple(problem.candidates[j] for j in found)
    explanations = {
        name: tuple(
            Explanation(r.effect, tuple(problem.candidates[j] for j in r.terms), r.sigmas, r.alias) for r in rivals
        )
        for name, rivals in finding.classes.items()
    }
    gamma = np.array([after.coefficients[j].value for j in found])
    return WholePlotTrace(sensors, formula, scene, chosen, gamma, len(data), explanations)


def scene_of(data: WholePlotData) -> PressureScene:
    """References of a run: mean temperatures, middle of the time, and each transducer's slope with pressure."""
    index = data.whole_plot_index
    p = data.pressure_psia - (np.bincount(index, data.pressure_psia) / np.bincount(index))[index]
    square = max(float(p @ p), np.finfo(float).tiny)
    return PressureScene(
        data=data,
        sensor_degC=float(np.mean(data.sensor_temperature_degC)),
        sse_degC=float(np.mean(data.sse_temperature_degC)),
        elapsed_s=float(np.mean(data.elapsed_s)),
        sensitivity={s: float(p @ y) / square for s, y in data.outputs.items()},
    )


def left_out(problem: Problem, family: Family, found: tuple[int, ...]) -> FloatArray | None:
    """(2, S) rms error on whole plots left out, mV, before and after; None where too few are left without one.

    The search is repeated without the whole plots that are left out, whose own errors are predicted as zero: one at a
    time, or `FOLDS` times several. Where nothing was found there is nothing to repeat.
    """
    squares = np.zeros((2, len(problem.sensors)))
    fold = problem.whole_plot % FOLDS
    for left in range(int(fold.max()) + 1):
        inside, aside = np.flatnonzero(fold != left), np.flatnonzero(fold == left)
        rest = problem.take(inside)
        try:
            design = SplitPlotDesign(rest.declared, rest.whole_plot, rest.names)
            chosen = search_and_name(WholePlotJudge(rest, family))[1] if found else ()
            coefficients = coefficients_of(rest, chosen)
            plain = design.fit_many(rest.outputs.T).coefficients
            beside_effects = design.fit_many((rest.outputs - contributed(rest, coefficients)).T).coefficients
        except (RankError, ValueError):
            return None
        columns, outputs = problem.declared[aside], problem.outputs[:, aside]
        squares[0] += np.sum((outputs - plain @ columns.T) ** 2, axis=1)
        corrected = outputs - contributed(problem, coefficients, aside)
        squares[1] += np.sum((corrected - beside_effects @ columns.T) ** 2, axis=1)
    return np.asarray(np.sqrt(squares / problem.outputs.shape[1]))


def _settle(
    data: WholePlotData, problem: Problem, seed: int
) -> tuple[Problem, Family, tuple[int, ...], tuple[Noise, ...]]:
    """Search; then weight readings by the noise found beside the effects, and search again until both stand still.

    Noise is looked for beside the effects and not before them: an effect of pressure not yet in the model is largest
    at the highest pressures, and would pass for noise that grows.
    """
    plain, family = problem, family_of(problem, seed)
    _, chosen = search_and_name(WholePlotJudge(problem, family))
    known: tuple[bool, ...] = (False,) * len(problem.sensors)
    for _ in range(ROUNDS):
        noise = noises(plain, chosen, data.pressure_psia)
        grows = tuple(stands_out(one, len(noise)) for one in noise)
        if grows == known:
            break
        known = grows
        problem, _ = weighted(plain, chosen, data.pressure_psia, noise, grows)
        family = family_of(problem, seed)
        judge = WholePlotJudge(problem, family)
        _, chosen = search_and_name(judge, prune(judge, chosen))
    else:
        noise = noises(plain, chosen, data.pressure_psia)
    problem, noise = weighted(plain, chosen, data.pressure_psia, noise, known)
    return problem, family, chosen, noise
