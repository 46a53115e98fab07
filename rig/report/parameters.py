"""The calibration's parameters for people: b, S, Omega and A, or b, S and phi, each with its standard error."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fitter import LinearFit, RankError, attitude_columns, least_squares
from fitter.attitude import AXES, attitude_parameters, fit_columns, no_roll_parameters
from fitter.trace.problem import raw_columns

if TYPE_CHECKING:
    from fitter.arrays import FloatArray
    from rig.closed_loop import AttitudeTraced


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
    alone = _by_name(found.declared, before.coefficients, before.covariance)
    beside = _by_name(found.declared, found.fit.coefficients, covariance)
    return [Parameter(name, with_error(*alone[name]), with_error(*beside[name])) for name in alone]


def _root_beside(h: FloatArray, effects: FloatArray, fit: LinearFit) -> FloatArray:
    """(k, k + q) root of the model's block of (X'X)^-1 with the effects' columns in X; NaN where they are alike."""
    names = (*fit.names, *(f"effect {i}" for i in range(effects.shape[1])))
    try:
        joint = least_squares(np.column_stack([h, effects]), np.zeros(len(h)), names)
    except RankError:
        return np.full_like(fit.root, np.nan)
    return joint.root[: len(fit.names)]


def _by_name(declared: str, coefficients: FloatArray, covariance: FloatArray) -> dict[str, tuple[float, float]]:
    axis = AXES.get(declared.removeprefix("attitude-"))
    if axis is None:
        p = no_roll_parameters(coefficients, covariance)
        values = {"b / V": p.b_V, "S / (V/g)": p.S_V, "phi / deg": p.phi_deg}
        errors = p.stderr
    else:
        q = attitude_parameters(axis, coefficients, covariance)
        values = {"b / V": q.b_V, "S / (V/g)": q.S_V, "Omega / deg": q.Omega_deg, "A / deg": q.A_deg}
        errors = q.stderr
    return {name: (value, float(error)) for (name, value), error in zip(values.items(), errors, strict=True)}


def with_error(estimate: float, error: float) -> tuple[str, str]:
    """Estimate and standard error as text: the error to two digits, the estimate to the same decimal place."""
    if not np.isfinite(estimate):
        return "-", "-"
    if not (np.isfinite(error) and error > 0):
        return f"{estimate:.8g}", "-"
    places = max(0, 1 - int(f"{error:.1e}".partition("e")[2]))  # the exponent of the error as it will be rounded
    return f"{estimate:.{places}f}", f"{error:.{places}f}"
