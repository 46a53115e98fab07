"""Influences kept in a calibration file, so that its use has total uncertainties."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isfinite
from typing import Any

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.procedures.evaluate.budgeting import NOT_COVERED, Evaluation
from rig.procedures.evaluate.influences import StoredInfluence, explain, kept
from rig.verbs.budget.evaluation import Evaluated, OfRun
from rig.verbs.budget.held import held
from rig.verbs.data.budget_lines import WITHOUT, lines_in_use
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
