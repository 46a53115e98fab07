"""The check of a run's budgets by simulation: the whole evaluation, repeated with random errors of all influences.

A budget is linear in errors. Here every error changes the recorded columns, readings in use and constants together, and
everything is evaluated anew (JCGM 101).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.budget.draws import Evaluate
from rig.procedures.evaluate.budgeting import Evaluation, Reading, Shift, Shifts, no_error


def whole(evaluation: Evaluation, shifts: Sequence[Shifts], each: Callable[[], None] | None = None) -> Evaluate:
    """The evaluation as a function of errors: (n, p) in standard uncertainties, to (n, m) results.

    Args:
        evaluation: of corrected columns.
        shifts: p changes of its inputs, as `influences` finds them.
        each: called after each evaluation.
    """
    exact: dict[str, float] = {}
    for one in shifts:
        exact.update(one(0.0).constants)

    def evaluate(errors: FloatArray) -> FloatArray:
        found = []
        for row in errors.tolist():
            changes = [one(error) for one, error in zip(shifts, row, strict=True)]
            found.append(evaluation.evaluate(together(changes, exact)))
            if each is not None:
                each()
        return np.array(found).reshape(len(errors), -1)

    return evaluate


def together(changes: Sequence[Shift], exact: Mapping[str, float]) -> Shift:
    """The sum of changes.

    Args:
        changes: of the inputs.
        exact: values of the constants without error.
    """
    columns: dict[str, FloatArray] = {}
    constants = dict(exact)
    for one in changes:
        for name, moved in one.columns.items():
            columns[name] = columns[name] + moved if name in columns else moved
        for name, value in one.constants.items():
            constants[name] += value - exact[name]
    readings = [one.in_use for one in changes if one.in_use is not no_error]
    return Shift(columns, _sum(readings) if readings else no_error, constants)


def _sum(readings: Sequence[Reading]) -> Reading:
    def added(name: str, values: FloatArray) -> FloatArray:
        total = np.zeros_like(values)
        for one in readings:
            total = total + one(name, values)
        return total

    return added
