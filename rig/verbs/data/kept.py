"""Influences kept in a calibration file, so that its use has total uncertainties."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from math import isfinite
from typing import Any

import numpy as np

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.budget import TypeA
from rig.fitter.errors import FitError
from rig.fitter.json_values import if_finite
from rig.procedures.errors import DataError
from rig.procedures.evaluate.budgeting import NOT_COVERED, Evaluation
from rig.procedures.evaluate.influences import StoredInfluence, explain, kept
from rig.procedures.tables.table import Table
from rig.verbs.budget.evaluation import Evaluated, OfRun
from rig.verbs.budget.found import effects_by_sensor
from rig.verbs.budget.held import held
from rig.verbs.budget.lacking import by_sensor, lacking, left_out
from rig.verbs.budget.undeclared import undeclared_lines
from rig.verbs.infer.total import TOTAL

UNSTATED = ", but for errors that the register does not state"


def budget_section(
    of: OfRun, evaluated: Evaluated, given: Mapping[str, Any], without: Sequence[str] | None
) -> dict[str, Any]:
    """The section "budget" of a calibration file.

    Args:
        of: the run, with its register.
        evaluated: the evaluation of it by the model of the calibration, at points.
        given: options of its kind.
        without: effects that are known and not in the model; None for all that a trace finds.

    Raises:
        DataError: its kind has no budgets, or the run cannot be evaluated.
    """

    def at(points: Sequence[Mapping[str, float]]) -> Evaluation:
        found = evaluated(points, of.stated.constants)
        explain(found, of.stated)
        return found

    evaluation = at(())
    influences, notes = kept(evaluation, of.stated)
    more = lines_in_use(of, at, given, without)
    in_lines = {line["name"] for every in more.lines.values() for line in every}
    told = {f"{name}{NOT_COVERED}": f"{name}: it is in the intervals, as in the budget of the run" for name in in_lines}
    notes = [*more.notes, *(told.get(note, note) for note in notes)]
    lacking = of.stated.what_is_lacking(of.stated.unstated(evaluation.columns))
    notes[:0] = [*lacking, *of.stated.unused]
    notes += held(of.table, of.config.temperatures, evaluation, ())
    if without and not more.whole:
        notes.insert(0, f"{', '.join(without)}: not in the model of the calibration; intervals have it only as scatter")
    if of.corrected:
        notes.insert(0, f"corrected by the certificates: {', '.join(of.corrected)}")
    if of.stated.example:
        notes.insert(0, f"the register {of.register.name!r} has example values")
    section: dict[str, Any] = {
        "register": of.register.name,
        "example": of.stated.example,
        "influences": [_json(one) for one in influences],
        "lines": more.lines,
        "scatter": more.scatter,
        "uncertainty": f"{TOTAL if more.whole else WITHOUT}{UNSTATED if lacking else ''}",
        "notes": [*notes, *evaluation.notes()],
    }
    stored = evaluation.stored()
    return section if stored is None else {**section, "calibration": stored}


def _json(one: StoredInfluence) -> dict[str, Any]:
    return {
        "name": one.name,
        "source": one.source,
        "df": one.df if isfinite(one.df) else None,
        "modes": [{"up": _lists(up), "down": _lists(down)} for up, down in one.modes],
        "in_use": {name: list(line) for name, line in one.in_use.items()},
    }


def _lists(coefficients: Mapping[str, FloatArray]) -> dict[str, list[float]]:
    return {sensor: np.asarray(values).tolist() for sensor, values in coefficients.items()}


WITHOUT = "total by the model, without effects beside it"
BESIDE = (
    "effects that the declared model lacks are in no interval here. rig budget and certificates trace the run, and "
    "have a line for those that they find; rig fit --traced or --confirmed-by gives a calibration with them"
)
COUNTED = "The difference in these states and conditions is in the intervals, as in the budget of the run"
NAMELESS = "the trace left more than error in {} and found no cause: that is in no interval"
_SMALL = 1e-3
"""Share of a line in the variance of a result below which it is not kept."""

At = Callable[[Sequence[Mapping[str, float]]], Evaluation]


@dataclass(frozen=True)
class Lines:
    """All that is kept.

    Attributes:
        lines: by output, as JSON values.
        scatter: by output, the scatter of the budget beside that of the calibration, as JSON values.
        notes: sentences about them.
        whole: whether intervals in use have all that the budget has.
    """

    lines: Mapping[str, Sequence[Mapping[str, Any]]]
    scatter: Mapping[str, Mapping[str, Any]]
    notes: Sequence[str]
    whole: bool


def lines_in_use(of: OfRun, at: At, given: Mapping[str, Any], lacks: Collection[str] | None) -> Lines:
    """Lines for the use of a calibration.

    Args:
        of: the run.
        at: its evaluation at points, by the model of the calibration.
        given: options of its kind.
        lacks: effects that the model lacks; None for all that a trace finds.
    """
    model = at(())
    grids, states = model.grids(), list(by_sensor(left_out(of.table, model, ()), {}))
    if not grids:
        return Lines({}, {}, [*states, *([BESIDE] if lacks is None else [])], lacks is not None and not lacks)
    notes: list[str] = []
    effects: Mapping[str, Sequence[str]] = {}
    with_effects: Evaluation | None = None
    whole = True
    if lacks is None or lacks:
        chosen = of.kind.budget_options(**{**given, "traced": True})
        try:
            with_effects = of.kind.evaluation(of.table, chosen, (), of.stated.constants)
            every = effects_by_sensor(with_effects.outcomes)
            effects = {s: [one for one in names if lacks is None or one in lacks] for s, names in every.items()}
            nameless = [one.sensor for one in with_effects.outcomes if one.unnamed]
            notes, whole = [NAMELESS.format(", ".join(nameless))] if nameless else [], not nameless
        except (DataError, FitError) as error:
            notes, whole = [f"{BESIDE}: {error}"], False
    lines: dict[str, list[dict[str, Any]]] = {}
    scatter: dict[str, dict[str, Any]] = {}
    for variable, points in dict(grids.values()).items():
        here = at(points)
        places: list[tuple[Evaluation, list[TypeA]]] = [(here, [])]
        if with_effects is not None and any(effects.values()):
            ends, others = _at_ends(of.table, points, variable)
            try:
                each = [(here, points), *((at(one), one) for one in ends)]
                places = [(one, undeclared_lines(one, with_effects.moved_to(own), effects)) for one, own in each]
                told = lacking(of.table, here, with_effects, effects)
                largest = f", at its largest over {', '.join(others)}" if others else ""
                notes += [f"{output}: {sentence} {COUNTED}{largest}" for output, sentence in told.items()]
            except (DataError, FitError) as error:
                notes, whole = [*notes, f"{BESIDE}: {error}"], False
        for output in (name for name, (own, _) in grids.items() if own == variable):
            lines[output] = _largest([list(_lines(one, output, variable, extra)) for one, extra in places])
            if (changed := _scatter(here, output, variable)) is not None:
                scatter[output] = changed
    return Lines({output: every for output, every in lines.items() if every}, scatter, [*states, *notes], whole)


def _at_ends(
    table: Table, points: Sequence[Mapping[str, float]], variable: str
) -> tuple[list[Sequence[Mapping[str, float]]], list[str]]:
    """The points with each other quantity at its lowest and at its highest value of the run, and names of these.

    Effects beside the model may be nothing at the means, where the points are, and most at an end.
    """
    others = [name for name in points[0] if name != variable and np.ptp(table.columns[name]) > 0.0]
    ends = [(name, float(end(table.columns[name]))) for name in others for end in (np.min, np.max)]
    return [[{**one, name: value} for one in points] for name, value in ends], others


def _largest(places: Sequence[Sequence[dict[str, Any]]]) -> list[dict[str, Any]]:
    """Lines with their largest uncertainty of all places, by name."""
    found: dict[str, dict[str, Any]] = {}
    for line in chain(*places):
        known = found.setdefault(line["name"], line)
        for key in ("u", "deviation"):
            if key in line:
                known[key] = np.maximum(known.get(key, 0.0), line[key]).tolist()
    return list(found.values())


def _inferred(here: Evaluation, output: str, variable: str) -> tuple[IntArray, FloatArray]:
    """(p,) places of the results that are inferred from an output, and the quantity there."""
    results = here.results
    pairs = zip(results.names, results.sensors, strict=True)
    mine = [i for i, (name, sensor) in enumerate(pairs) if sensor == output and " inferred " in name]
    return np.array(mine, np.int64), np.array([results.at[i][variable] for i in mine])


def _lines(here: Evaluation, output: str, variable: str, extra: Sequence[TypeA]) -> Iterator[dict[str, Any]]:
    """Lines of the results that are inferred from an output."""
    mine, place = _inferred(here, output, variable)
    own = np.diag(here.results.type_a.covariance)[mine]
    for line in chain(here.reversibility(), here.model_errors(), extra):
        variance = np.maximum(np.diag(line.covariance)[mine], 0.0)
        if (variance > _SMALL * own).any():
            df = if_finite(np.min(line.df))
            told = {"name": line.name, "df": df, "at": place.tolist(), "u": np.sqrt(variance).tolist()}
            side = None if line.deviation is None else np.abs(line.deviation[mine]).tolist()
            yield told if side is None else {**told, "deviation": side}


def _scatter(here: Evaluation, output: str, variable: str) -> dict[str, Any] | None:
    """Variance of the budget's scatter less that of the calibration, with the former's degrees of freedom; None where
    they are the same.
    """
    mine, place = _inferred(here, output, variable)
    type_a = here.results.type_a
    own, df = np.diag(type_a.covariance)[mine], np.broadcast_to(type_a.df, len(here.results.names))[mine]
    more = own - here.kept_variance(output)
    if not (np.abs(more) > _SMALL * own).any():
        return None
    return {"at": place.tolist(), "more": more.tolist(), "inverse_df": (1.0 / df).tolist()}
