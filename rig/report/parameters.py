"""The calibration's parameters for people: b, S, Omega and A, or b, S and phi, each with its standard error."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fitter import LinearFit, RankError, attitude_columns, least_squares
from fitter.attitude import AXES, attitude_parameters, fit_columns, no_roll_parameters
from fitter.calibration import parameter_table
from fitter.trace.problem import raw_columns

if TYPE_CHECKING:
    from collections.abc import Mapping

    from fitter.arrays import FloatArray
    from rig.closed_loop import AttitudeTraced


LABELS = {
    "b_V": "b / V",
    "S_V": "S / (V/g)",
    "phi_deg": "phi / deg",
    "Omega_deg": "Omega / deg",
    "A_deg": "A / deg",
    "mx_V": "m_x / (V/g)",
    "my_V": "m_y / (V/g)",
    "mz_V": "m_z / (V/g)",
}
"""What the parameters of `fitter.calibration.parameter_table` are called where people read them."""
NO_DIRECTION = "the sensitive axis leans too little to say where to: Omega and A have no intervals, its components m do"


class Parameter(NamedTuple):
    """One parameter of a sensor as text: estimate and standard error, before and after the effects are taken out."""

    name: str
    before: tuple[str, str]
    after: tuple[str, str]


def parameters(traced: AttitudeTraced, sensor: str) -> list[Parameter]:
    """Every parameter of one sensor, of the declared model alone and beside the effects found.

    The fit beside the effects takes their coefficients as known. Its standard errors here do not: the effects'
    columns stand in the design with the model's, which is exact for an effect of this sensor alone and somewhat
    too wide for one that several sensors determine together. Where one sensor alone cannot tell an effect from the
    model there is a dash.
    """
    data, found = traced.data, traced.trace.sensors[sensor]
    h = attitude_columns(data.pitch_deg, data.roll_deg, roll=data.has_roll)
    before = fit_columns(h, data.outputs[sensor])
    own = raw_columns(traced.trace.scene.on(data), traced.trace.chosen)[list(traced.trace.sensors).index(sensor)]
    root = _root_beside(h, own[:, np.any(own != 0, axis=0)], found.fit)
    covariance = found.after.sigma_E**2 * root @ root.T
    alone = _table(found.declared, before.coefficients, before.covariance, before.df)
    beside = _table(found.declared, found.fit.coefficients, covariance, found.fit.df)
    return [Parameter(LABELS[name], _text(alone[name]), _text(beside[name])) for name in shown(alone)]


def shown(table: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Which parameters to show: the sensitive axis only where Omega and A are no estimates with errors around them."""
    known = "Omega_deg" not in table or table["Omega_deg"]["interval95"] is not None
    return [name for name in table if not (known and name.startswith("m"))]


def _root_beside(h: FloatArray, effects: FloatArray, fit: LinearFit) -> FloatArray:
    """(k, k + q) root of the model's block of (X'X)^-1 with the effects' columns in X; NaN where they are alike."""
    names = (*fit.names, *(f"effect {i}" for i in range(effects.shape[1])))
    try:
        joint = least_squares(np.column_stack([h, effects]), np.zeros(len(h)), names)
    except RankError:
        return np.full_like(fit.root, np.nan)
    return joint.root[: len(fit.names)]


def _table(declared: str, coefficients: FloatArray, covariance: FloatArray, df: int) -> Mapping[str, Any]:
    axis = AXES.get(declared.removeprefix("attitude-"))
    if axis is None:
        return parameter_table(no_roll_parameters(coefficients, covariance), df)
    return parameter_table(attitude_parameters(axis, coefficients, covariance), df)


def _text(row: Mapping[str, float | None]) -> tuple[str, str]:
    estimate, error = row["estimate"], row["stderr"]
    return with_error(np.nan if estimate is None else estimate, np.nan if error is None else error)


def with_error(estimate: float, error: float) -> tuple[str, str]:
    """Estimate and standard error as text: the error to two digits, the estimate to the same decimal place."""
    if not np.isfinite(estimate):
        return "-", "-"
    if not (np.isfinite(error) and error > 0):
        return f"{estimate:.8g}", "-"
    places = max(0, 1 - int(f"{error:.1e}".partition("e")[2]))  # the exponent of the error as it will be rounded
    return f"{estimate:.{places}f}", f"{error:.{places}f}"
