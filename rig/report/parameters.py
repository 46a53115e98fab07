"""The calibration's parameters for people: b, S, Omega and A, or b, S and phi, each with its standard error."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fitter import RankError, fit_attitude
from fitter.attitude import AttitudeParameters, NoRollParameters, attitude_parameters, no_roll_parameters
from fitter.calibration import AttitudeFit, parameter_table, temperature_table
from fitter.temperature import Temperature

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
    "dbdT_uV_per_degC": "db/dT / (uV/degC)",
    "dSdT_ppm_per_degC": "dS/dT / (ppm/degC)",
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

    Those beside the effects are those of the calibration that `rig fit --traced` keeps. Where the points do not
    determine the model with the effects there are dashes in the place of standard errors.
    """
    data, found = traced.data, traced.trace.sensors[sensor]
    before = fit_attitude(data, sensor, temperature=traced.temperature)
    alone = _rows(before.parameters, before.parameters_df, before.temperature, before.linear.df)
    beside = alone  # what other sensors' effects do to this one is too little to name
    if found.effects:
        warm = temperature_table(found.temperature, before.parameters.S_V, found.fit.df)
        try:
            beside = {**parameter_table(*traced.calibration.parameters(sensor)), **warm}
        except RankError:
            unknown = np.full((len(found.fit.coefficients),) * 2, np.nan)
            beside = {**parameter_table(_converted(before, found.fit.coefficients, unknown), found.fit.df), **warm}
    return [Parameter(LABELS[name], _text(alone[name]), _text(beside[name])) for name in shown(alone)]


def shown(table: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Which parameters to show: the sensitive axis only where Omega and A are no estimates with errors around them."""
    known = "Omega_deg" not in table or table["Omega_deg"]["interval95"] is not None
    return [name for name in table if not (known and name.startswith("m"))]


def _converted(
    declared: AttitudeFit, coefficients: FloatArray, covariance: FloatArray
) -> AttitudeParameters | NoRollParameters:
    if isinstance(declared.parameters, NoRollParameters):
        return no_roll_parameters(coefficients, covariance)
    return attitude_parameters(declared.parameters.axis, coefficients, covariance)


def _rows(
    parameters: AttitudeParameters | NoRollParameters, df: int, temperature: Temperature | None, df_temperature: int
) -> Mapping[str, Any]:
    return parameter_table(parameters, df) | temperature_table(temperature, parameters.S_V, df_temperature)


def _text(row: Mapping[str, float | None]) -> tuple[str, str]:
    estimate, error = row["estimate"], row["stderr"]
    return with_error(np.nan if estimate is None else estimate, np.nan if error is None else error)


def with_error(estimate: float, error: float) -> tuple[str, str]:
    """Estimate and standard error as text: the error to two digits, the estimate to the same decimal place."""
    if not np.isfinite(estimate):
        return "-", "-"
    if not (np.isfinite(error) and error > 0):
        return f"{estimate:.8g}", "-"
    places = _places(error)
    return f"{estimate:.{places}f}", f"{error:.{places}f}"


def with_interval(row: Mapping[str, Any]) -> tuple[str, str, str]:
    """A row of `parameter_table` as text: estimate, standard error, and the 95 % interval to the same decimal place."""
    if row["interval95"] is None or None in row["interval95"]:
        return *_text(row), "-"
    low, high = row["interval95"]
    places = _places(row["stderr"]) if row["stderr"] else 8
    return *_text(row), f"{low:.{places}f} to {high:.{places}f}"


def _places(error: float) -> int:
    return max(0, 1 - int(f"{error:.1e}".partition("e")[2]))  # the exponent of the error as it will be rounded
