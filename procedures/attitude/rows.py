"""Attitude sensors: the calibration's parameters before and after the effects, and plots of each effect."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from rig.fitter import RankError
from rig.fitter.effects.noise_names import OUTLIERS
from rig.fitter.linear import orthonormal
from rig.fitter.trace.outcome import Figure, Parameter, WithError
from rig.procedures.attitude.fit import AttitudeFit, parameter_table, temperature_table
from rig.procedures.attitude.model import AttitudeParameters, NoRollParameters, attitude_parameters, no_roll_parameters
from rig.procedures.attitude.parameters import LABELS, SCALE, UNIT, shown
from rig.procedures.attitude.trace import SensorTrace

if TYPE_CHECKING:
    from rig.fitter.arrays import FloatArray
    from rig.procedures.attitude.data import AttitudeData
    from rig.procedures.attitude.infer import AttitudeCalibration
    from rig.procedures.attitude.temperature import Temperature

_VARIABLES = {
    "pitch_deg": ("pitch / deg", 1.0),
    "roll_deg": ("roll / deg", 1.0),
    "elapsed_s": ("bench time / h", 1 / 3600.0),
    "sensor_temperature_degC": ("sensor temperature / degC", 1.0),
}
"""Label and scale of the fields of the data for plots of effects."""


def parameter_rows(
    declared: AttitudeFit, found: SensorTrace, calibration: Callable[[], AttitudeCalibration]
) -> tuple[Parameter, ...]:
    """Every parameter of one sensor, with the declared model alone and with the effects found.

    Those with the effects are those of the calibration of `rig fit --traced`. If the points do not determine the model
    with the effects they have no standard errors.

    Args:
        declared: fit of the declared model alone.
        found: findings in the sensor.
        calibration: with the effects; called only if there are any.
    """
    alone = _table(declared.parameters, declared.parameters_df, declared.temperature, declared.linear.df)
    beside = alone  # the influence of other sensors' effects on this one is negligible
    if found.added:
        warm = temperature_table(found.temperature, declared.parameters.S_V, found.fit.df)
        try:
            beside = {**parameter_table(*calibration().parameters(found.sensor)), **warm}
        except RankError:
            unknown = np.full((len(found.fit.coefficients),) * 2, np.nan)
            converted = _converted(declared, found.fit.coefficients, unknown)
            beside = {**parameter_table(converted, found.fit.df), **warm}
    return tuple(
        Parameter(name, WithError.of_json(beside[name]), WithError.of_json(alone[name]), label=LABELS[name])
        for name in shown(alone)
    )


def _converted(
    declared: AttitudeFit, coefficients: FloatArray, covariance: FloatArray
) -> AttitudeParameters | NoRollParameters:
    if isinstance(declared.parameters, NoRollParameters):
        return no_roll_parameters(coefficients, covariance)
    return attitude_parameters(declared.parameters.axis, coefficients, covariance)


def _table(
    parameters: AttitudeParameters | NoRollParameters, df: int, temperature: Temperature | None, df_temperature: int
) -> Mapping[str, Any]:
    return parameter_table(parameters, df) | temperature_table(temperature, parameters.S_V, df_temperature)


def effect_figures(
    data: AttitudeData, declared: AttitudeFit, found: SensorTrace, outliers: Iterable[int]
) -> dict[str, Figure]:
    """Plot data of every effect and finding about noise of one sensor, by its name.

    Args:
        data: the run.
        declared: fit of the declared model alone.
        found: findings in the sensor.
        outliers: rows left out of the search; shown only in the finding about them.
    """
    to_unit = np.degrees(1.0 / found.S_V) * SCALE
    residual = found.residual_after_V * to_unit
    basis = orthonormal(np.column_stack([declared.columns(data.pitch_deg, data.roll_deg), declared.beside(data)]))
    every = np.arange(len(data))
    kept = np.setdiff1d(every, tuple(outliers))
    figures = {}
    for effect in found.effects:
        name, (label, scale) = _variable(effect.against)
        rows = every if effect.effect == OUTLIERS else kept
        x, left, adds = getattr(data, name)[rows] * scale, residual[rows], None
        if effect.kind == "effect":
            adds = ((effect.contribution_V - basis @ (basis.T @ effect.contribution_V)) * to_unit)[rows]
        figures[effect.effect] = Figure(x, label, left, adds, UNIT)
    return figures


def _variable(against: str) -> tuple[str, tuple[str, float]]:
    """Field of the data for a plot of an effect, with label and scale; time for an effect without a label here."""
    name = against if against in _VARIABLES else "elapsed_s"
    return name, _VARIABLES[name]
