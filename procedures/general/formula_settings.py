"""Settings of a declared formula: its columns, and functions of them in it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from rig.fitter.arithmetic import Expression
from rig.fitter.arrays import FloatArray
from rig.fitter.formula import Formula


def settings_of(formula: Formula, columns: Mapping[str, Any]) -> dict[str, FloatArray]:
    """(n,) values of each setting that differs between rows, in the order of the formula.

    Last are columns that the formula has only in functions, such as R in `log(R)` and p in `I(p / T)`: the declared
    model says nothing of what each of them does by itself.
    """
    factors = [factor.expression for term in formula.terms for factor in term.numeric]
    found: dict[str, FloatArray] = {}
    for expression in map(_base, factors):
        name = expression.of[0] if expression.operation == "name" else str(expression)
        found[name] = np.asarray(expression.value(columns), np.float64)
    for name in (name for expression in factors for name in expression.names):
        found.setdefault(name, np.asarray(columns[name], np.float64))
    return {name: v for name, v in found.items() if np.ptp(v) > 0}


def subtracted(response: Formula) -> tuple[str, ...]:
    """The setting whose coefficient is declared to be one, if the response is a difference to it."""
    expression = response.terms[0].numeric[0].expression
    right = expression.of[1] if expression.operation == "-" else None
    return right.of if right is not None and right.operation == "name" else ()


def _base(expression: Expression) -> Expression:
    """The base of a power; everything else unchanged."""
    if expression.operation == "^" and expression.of[1].operation == "number":
        return _base(expression.of[0])
    return expression
