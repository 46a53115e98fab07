"""Influences kept in a calibration file, so that its use has total uncertainties."""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite
from typing import Any

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.procedures.evaluate.influences import StoredInfluence, explain, kept
from rig.verbs.budget.evaluation import OfRun

REPEATABILITY = "repeatability only"


def budget_section(of: OfRun, options: Mapping[str, Any]) -> dict[str, Any]:
    """The section "budget" of a calibration file.

    Args:
        of: the run, with its register.
        options: of `rig budget` for its kind.

    Raises:
        DataError: its kind has no budgets, or the run cannot be evaluated.
    """
    evaluation = of.kind.evaluation(of.table, of.kind.budget_options(**options), (), of.stated.constants)
    explain(evaluation, of.stated)
    influences, notes = kept(evaluation, of.stated)
    if of.corrected:
        notes.insert(0, f"corrected by the certificates: {', '.join(of.corrected)}")
    if of.stated.example:
        notes.insert(0, f"the register {of.register.name!r} has example values")
    section: dict[str, Any] = {
        "register": of.register.name,
        "example": of.stated.example,
        "influences": [_json(one) for one in influences],
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
