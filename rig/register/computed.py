"""Columns that are computed from a reading: a factor, by the formula of its reference standard, and the way back."""

from __future__ import annotations

import numpy as np

from rig.errors import ConfigurationError
from rig.fitter.arithmetic_text import parse_expression
from rig.fitter.arrays import FloatArray
from rig.procedures.evaluate.stated import Computed

_ITERATIONS, _STEP, _CLOSE = 60, 1e-6, 1e-9


def computed_from(column: str, formula: str, unit: float) -> Computed:
    """The relation of a column to the quantity that a meter behind it reads.

    Args:
        column: its name.
        formula: of `reading`, as in the bench file.
        unit: units of the reading in one of the quantity's.

    The way back raises `ConfigurationError` where no reading gives a value.
    """
    expression = parse_expression(formula)

    def value(reading: FloatArray) -> FloatArray:
        with np.errstate(all="ignore"):
            return np.asarray(expression.value({"reading": reading}) + 0.0 * reading, np.float64)

    def back(values: FloatArray) -> FloatArray:
        """Newton's method, from the straight line through the readings 0 and 1."""
        start, end = value(np.array([0.0, 1.0]))
        with np.errstate(all="ignore"):
            line = (values - start) / (end - start)
            x = np.where(np.isfinite(line), line, 1.0)
            for _ in range(_ITERATIONS):
                h = _STEP * np.maximum(np.abs(x), _STEP)
                x = x - (value(x) - values) * 2.0 * h / (value(x + h) - value(x - h))
            off = ~(np.abs(value(x) - values) <= _CLOSE * np.maximum(np.abs(values), np.ptp(values)))
        off &= np.isfinite(values)
        if off.any():
            raise ConfigurationError(
                f"references.{column}.formula: no reading was found that gives {column} = {values[off][0]:.6g}, so the "
                f"errors of the meter that reads it cannot be counted: correct the formula, or state them of {column}"
            )
        return np.asarray(x)

    return Computed(lambda values: back(values) / unit, lambda quantity: value(quantity * unit))
