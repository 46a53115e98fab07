"""The whole trace of whole plots, from the residual to the effect."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.errors import FitError
from rig.fitter.split_plot import SplitPlotDesign
from rig.fitter.steps import steps
from rig.fitter.trace.found import explanations_of
from rig.fitter.trace.refusals import refusals
from rig.procedures.pressure.data import WholePlotData
from rig.procedures.pressure.effects import PRESSURE_CATALOGUE
from rig.procedures.pressure.effects.scene import PressureEffect, PressureScene
from rig.procedures.pressure.fit import HIERARCHICAL, named_formula
from rig.procedures.pressure.fit.models import check_determined
from rig.procedures.pressure.trace.agreement import named
from rig.procedures.pressure.trace.estimate import contributed, estimate, left_to_plots
from rig.procedures.pressure.trace.judge import WholePlotJudge
from rig.procedures.pressure.trace.problem import pose
from rig.procedures.pressure.trace.reasons import Run
from rig.procedures.pressure.trace.report import transducer
from rig.procedures.pressure.trace.result import WholePlotTrace
from rig.procedures.pressure.trace.settle import settle

FOLDS = 24
"""Maximum number of repeats with left-out whole plots."""
_SEARCH = 0.5
"""About the part of the time that the search takes before whole plots are left out."""


def trace_whole_plots(
    data: WholePlotData,
    model: str = "full",
    catalogue: Sequence[PressureEffect] = PRESSURE_CATALOGUE,
    *,
    validate: bool = True,
) -> WholePlotTrace:
    """Find effects missing in the declared model of pressure transducers.

    Args:
        data: a whole-plot run; any number of transducers on one line, judged together.
        model: a name of `rig.procedures.pressure.fit.models`, or a formula; "hierarchical" is the full model, because a
            search could only restore its terms.
        catalogue: effects to search.
        validate: repeat the search without each whole plot for the left-out error, which takes most of the time.

    Raises:
        rig.fitter.linear.RankError: the observations do not determine the declared model.
        rig.fitter.formula.FormulaError: the model is neither a name nor a formula.
        FitError: the observations do not determine the model's errors; the message has the reason.
    """
    formula = named_formula(model)
    names, declared = formula.columns(data.table)
    check_determined(data, formula)
    scene = scene_of(data)
    settled = settle(pose(data, names, declared, scene, catalogue))
    judge, found = settled.judge, settled.chosen
    problem, before, after = judge.problem, estimate(judge, (), found), estimate(judge, found)
    told = Run(
        data=data,
        model=model if model != HIERARCHICAL else f"full (where {HIERARCHICAL} starts)",
        formula=formula,
        scene=scene,
        settled=settled,
        before=before,
        after=after,
        stated=left_to_plots(judge, before, after),
        cv=left_out(judge, found) if validate else None,
    )
    told = replace(told, refused=refusals(judge, found, told.classes, scene.sensitivity))
    sensors = {sensor: transducer(told, i) for i, sensor in enumerate(problem.sensors)}
    chosen = tuple(j for j in found if not problem.candidates[j].effect.of_noise)
    gamma, terms = [after.coefficients[j].value for j in chosen], tuple(problem.candidates[j] for j in chosen)
    classes = {c.effect.name: told.classes[c.effect.name] for c in terms}
    explanations = explanations_of(classes, problem.candidates)
    taken = np.ones((len(problem.sensors), len(chosen)))
    return WholePlotTrace(sensors, scene, terms, np.array(gamma), taken, len(data), formula, explanations=explanations)


def scene_of(data: WholePlotData) -> PressureScene:
    """References of a run: mean temperatures, middle of the time, and each transducer's slope and zero."""
    index = data.whole_plot_index
    p = data.pressure_psia - (np.bincount(index, data.pressure_psia) / np.bincount(index))[index]
    square = max(float(p @ p), np.finfo(float).tiny)
    slope = {s: float(p @ y) / square for s, y in data.outputs.items()}
    middle = float(np.mean(data.pressure_psia))
    return PressureScene(
        data=data,
        sensor_degC=float(np.mean(data.sensor_temperature_degC)),
        sse_degC=float(np.mean(data.sse_temperature_degC)),
        elapsed_s=float(np.mean(data.elapsed_s)),
        begun_s=float(np.min(data.elapsed_s)),
        sensitivity=slope,
        zero={s: float(np.mean(y)) - slope[s] * middle for s, y in data.outputs.items()},
    )


def left_out(judge: WholePlotJudge, found: tuple[int, ...]) -> FloatArray | None:
    """(2, S) rms error of left-out whole plots, mV, before and after; None if too few remain.

    The search is repeated without the left-out whole plots, whose own errors are predicted as zero: one at a time, or
    `FOLDS` times several. Without findings there is no repetition.
    """
    problem, outputs = judge.problem, judge.held(found)
    squares = np.zeros((2, len(problem.sensors)))
    fold = problem.whole_plot % FOLDS
    folds = int(fold.max()) + 1
    for left in steps(range(folds), lambda one: f"rows left out, {one + 1} of {folds}", after=_SEARCH):
        inside, aside = np.flatnonzero(fold != left), np.flatnonzero(fold == left)
        rest = problem.take(inside)
        try:
            design = SplitPlotDesign(rest.declared, rest.whole_plot, rest.names)
            part = judge.part(rest, inside, found)
            coefficients = part.coefficients(named(part)) if found else {}
            plain = design.fit_many(outputs[:, inside].T).coefficients
            beside_effects = design.fit_many((outputs[:, inside] - contributed(rest, coefficients)).T).coefficients
        except FitError:
            return None
        columns, apart = problem.declared[aside], outputs[:, aside]
        squares[0] += np.sum((apart - plain @ columns.T) ** 2, axis=1)
        corrected = apart - contributed(problem, coefficients, aside)
        squares[1] += np.sum((corrected - beside_effects @ columns.T) ** 2, axis=1)
    return np.asarray(np.sqrt(squares / problem.outputs.shape[1]))
