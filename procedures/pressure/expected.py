"""Expected readings of pressure transducers on a bench: by an earlier calibration, or by the declared model."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fitter.arrays import FloatArray
from procedures.expected import Columns, Expected
from procedures.pressure.fit import PressureCalibration, named_formula
from procedures.pressure.fit.models import FULL

PRESSURE = "pressure_psia"
_VARIABLES = {"P": PRESSURE, "T_sensor": "sensor_temperature_degC", "T_SSE": "sse_temperature_degC"}


def expected(
    calibration: Mapping[str, PressureCalibration], columns: Columns, mounting: Mapping[str, float]
) -> dict[str, Expected]:
    """See `procedures.expected.Expecting`; transducers are calibrated in their mounting."""
    if any(name not in columns for name in _VARIABLES.values()):
        return {}
    return {name: _expected(one, columns) for name, one in calibration.items()}


def _expected(one: PressureCalibration, columns: Columns) -> Expected:
    rows = one.formula.columns({name: columns[column] for name, column in _VARIABLES.items()})[1]
    own = np.einsum("nk,kl,nl->n", rows, one.covariance, rows)
    between, spread = one.errors.between_variance, float(one.errors.spread[2, 2])
    df = 2.0 * one.errors.wholeplot_variance**2 / spread if spread > 0.0 else 1e3
    shared = np.sqrt(np.maximum(own, 0.0) + between)
    return Expected(rows @ one.coefficients, one.errors.subplot_sd(columns[PRESSURE]), shared, max(1.0, df), 1)


def model_columns(columns: Columns) -> FloatArray | None:
    """(n, k) columns of the full second order; None if pressure or a temperature is unknown."""
    if any(name not in columns for name in _VARIABLES.values()):
        return None
    return named_formula(FULL).columns({name: columns[column] for name, column in _VARIABLES.items()})[1]
