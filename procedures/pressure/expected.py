"""Expected readings of pressure transducers on a bench: by an earlier calibration, or by the declared model."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.formula import Formula
from rig.procedures.plan.expected import Columns, Expected, Expecting
from rig.procedures.pressure.fit import PressureCalibration, named_formula
from rig.procedures.pressure.fit.models import FULL

PRESSURE = "pressure_psia"
_VARIABLES = {"P": PRESSURE, "T_sensor": "sensor_temperature_degC", "T_SSE": "sse_temperature_degC"}
_LARGEST = 1e60
"""Largest number accepted in a run file; its fifth power is still a double."""


def expecting(calibration: Mapping[str, PressureCalibration]) -> Expecting:
    """Expected readings of the sensors of a bench, for `rig.procedures.kind.Kind.expecting`."""
    return partial(expected, calibration)


def expected(
    calibration: Mapping[str, PressureCalibration], columns: Columns, mounting: Mapping[str, float]
) -> dict[str, Expected]:
    """Expected readings of the sensors of a bench: transducers are calibrated in their mounting."""
    if any(name not in columns for name in _VARIABLES.values()):
        return {}
    return {name: _expected(one, columns) for name, one in calibration.items()}


def _expected(one: PressureCalibration, columns: Columns) -> Expected:
    rows = _rows(one.formula, columns)
    own = np.einsum("nk,kl,nl->n", rows, one.covariance, rows)
    between, spread = one.errors.between_variance, float(one.errors.spread[2, 2])
    df = 2.0 * one.errors.wholeplot_variance**2 / spread if spread > 0.0 else 1e3
    shared = np.sqrt(np.maximum(own, 0.0) + between)
    return Expected(rows @ one.coefficients, one.errors.subplot_sd(columns[PRESSURE]), shared, max(1.0, df), 1)


def model_columns(columns: Columns, declared: Mapping[str, Any]) -> FloatArray | None:
    """(n, k) columns of the full second order; NaN as in `_rows`; None if pressure or a temperature is unknown."""
    if any(name not in columns for name in _VARIABLES.values()):
        return None
    return _rows(named_formula(FULL), columns)


def _rows(formula: Formula, columns: Columns) -> FloatArray:
    """(n, k) columns of a formula; a row is NaN if a quantity was not read, or is too large to be one."""
    given = {name: np.asarray(columns[column], np.float64) for name, column in _VARIABLES.items()}
    usable = np.all([np.abs(values) < _LARGEST for values in given.values()], axis=0)
    made = formula.columns({name: np.where(usable, values, 1.0) for name, values in given.items()})[1]
    made[~usable] = np.nan
    return made
