"""Fit one sensor of a pitch-roll calibration: the linear model; sigma_E and Table 2: `fitter/replication.py`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rig.fitter import LinearFit
from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.errors import FitError
from rig.fitter.json_values import JsonValue, if_finite
from rig.fitter.misfit import covered, lacks_fit, reach_of_misfit
from rig.fitter.quantiles import t_limit
from rig.fitter.replication import Replication, analyse, between_replications
from rig.procedures.attitude.data import AttitudeData
from rig.procedures.attitude.model import (
    AttitudeParameters,
    Interval,
    NoRollParameters,
    attitude_columns,
    attitude_parameters,
    fit_columns,
    no_roll_parameters,
    nominal_axis,
    sensitive_axis,
    sigma_deg,
)
from rig.procedures.attitude.temperature import Temperature

_DRIFTS = 0.05
_SIGMAS = ("sigma_E", "sigma_bias", "sigma_prec", "sigma_b", "sigma_S")


@dataclass(frozen=True, eq=False)
class AttitudeFit:
    """Calibration of one sensor.

    Attributes:
        sensor: column name of its output.
        model: "attitude-x", "attitude-y", "attitude-z" or "attitude-no-roll".
        linear: the least-squares fit of `rig.procedures.attitude.model.COLUMNS`, in volts.
        parameters: the paper's parameters. If replications drift (`drifts`), with errors from the replications,
            otherwise from the residuals.
        parameters_df: degrees of freedom of these errors.
        replication: Table 2.
        temperature: the temperature terms, if the declared model has them; the rest is then at their reference.
        degC: lowest, mean and highest sensor temperature of the run; None if it was not recorded.
        model_error: by parameter, its possible change by a model error as large as the lack of fit; None if lack of fit
            is not significant or cannot be tested.
        pitch_range_deg: lowest and highest pitch calibrated; outside it predictions are extrapolations.
        roll_range_deg: the same for roll.
    """

    sensor: str
    model: str
    linear: LinearFit
    parameters: AttitudeParameters | NoRollParameters
    parameters_df: int
    replication: Replication
    pitch_range_deg: tuple[float, float]
    roll_range_deg: tuple[float, float]
    temperature: Temperature | None = None
    degC: tuple[float, float, float] | None = None
    model_error: Mapping[str, float] | None = None

    @property
    def at_degC(self) -> float | None:  # noqa: N802 - units in names
        """Reference temperature of the parameters: as requested, or the mean; None if none was recorded."""
        if self.temperature is not None:
            return self.temperature.reference_degC
        return None if self.degC is None else self.degC[1]

    @property
    def at_words(self) -> str:
        """Reference temperature of the parameters, in words."""
        if self.degC is None:
            return "parameters hold at the sensor temperature of the run, which was not recorded"
        low, mean, high = self.degC
        span = f"{low:.2f} to {high:.2f} degC"
        if self.temperature is None:
            return f"parameters hold at {mean:.2f} degC, the mean of the run ({span}): no temperature in the model"
        at = self.temperature.reference_degC
        if at == mean:
            return f"parameters hold at {at:.2f} degC, the mean of the run ({span})"
        outside = "" if low <= at <= high else ", OUTSIDE what was measured: extrapolated"
        return f"parameters hold at {at:.2f} degC, as asked (measured from {span}{outside})"

    @property
    def drifts(self) -> bool:
        """Whether the parameters vary significantly between replications (T_drift, 5 %)."""
        return drifting(self.replication)

    @property
    def declared(self) -> str:
        """The declared model in words."""
        return self.model if self.temperature is None else f"{self.model} with temperature"

    @property
    def has_roll(self) -> bool:
        """Whether the model has roll."""
        return isinstance(self.parameters, AttitudeParameters)

    @property
    def sensitive_axis(self) -> FloatArray:
        """(3,) sensitive axis times sensitivity, V/g in package axes."""
        return sensitive_axis(self.linear.coefficients)

    def columns(self, pitch_deg: FloatArray, roll_deg: FloatArray) -> FloatArray:
        """(n, k) rows of the model at these angles, for the intervals of `linear`."""
        return attitude_columns(pitch_deg, roll_deg, roll=self.has_roll)

    def predict(self, pitch_deg: FloatArray, roll_deg: FloatArray) -> FloatArray:
        """(n,) output in volts at these angles, at the reference temperature."""
        return self.linear.predict(self.columns(pitch_deg, roll_deg))

    def beside(self, data: AttitudeData) -> FloatArray:
        """(n, q) further columns of the declared model for these observations; none without temperature."""
        if self.temperature is None:
            return np.empty((len(data), 0))
        return self.temperature.columns(self.columns(data.pitch_deg, data.roll_deg), data)

    def refitted(self, data: AttitudeData, output: FloatArray) -> tuple[LinearFit, Temperature | None]:
        """The declared model fitted to another output (n,) V of the same observations, such as one with effects
        removed.
        """
        h = self.columns(data.pitch_deg, data.roll_deg)
        if self.temperature is None:
            return fit_columns(h, output), None
        return self.temperature.fitted(h, data, output, self.linear.names)

    def to_dict(self) -> dict[str, JsonValue]:
        """JSON values; missing numbers are None, never NaN."""
        return {
            "model": self.declared,
            "points": self.linear.n,
            "pitch_range_deg": list(self.pitch_range_deg),
            "roll_range_deg": list(self.roll_range_deg),
            "coefficients": coefficient_table(self.linear),
            "errors_from": "replications" if self.parameters_df != self.linear.df else "residuals",
            "parameters": at_temperature(
                parameter_table(self.parameters, self.parameters_df)
                | temperature_table(self.temperature, self.parameters.S_V, self.linear.df),
                self.at_degC,
            ),
            "at_degC": self.at_degC,
            "at_degC_measured": None if self.degC is None else [self.degC[0], self.degC[2]],
            "at_degC_sentence": self.at_words,
            "intervals_cover": covered(replicated=self.parameters_df != self.linear.df),
            "model_error": None if self.model_error is None else dict(self.model_error),
            "reference_degC": None if self.temperature is None else self.temperature.reference_degC,
            **table_2(self.replication, self.parameters.S_V),
        }


def fit_attitude(
    data: AttitudeData, sensor: str, *, temperature: bool = False, at_degC: float | None = None
) -> AttitudeFit:
    """Calibrate one sensor: eq. (2), (4) or (5) by its nominal axis (`data.axes`), eq. (1) without roll.

    Args:
        data: the run.
        sensor: name of the output.
        temperature: whether offset and sensitivity depend on the sensor's temperature in the declared model.
        at_degC: reference temperature of the parameters, with `temperature`; None for the mean of the run.

    Raises:
        KeyError: `data` has no such output.
        rig.fitter.linear.RankError: the points do not determine the model.
        FitError: the output never changes, or there is no temperature to fit.
    """
    output = data.outputs[sensor]
    if np.ptp(output) == 0:
        raise FitError(f"{sensor} reads {output[0]:g} V at every attitude: there is nothing to calibrate")
    columns = data.rows.columns
    linear, own, beside = fit_columns(columns, output), None, np.empty((len(data), 0))
    carried = np.zeros((columns.shape[1], 2))
    if temperature:
        own = Temperature.of(data, columns, output, linear)
        if at_degC is not None:
            carried = own.moved(at_degC)
            own = replace(own, reference_degC=at_degC)
        linear, own = own.fitted(columns, data, output, linear.names)
        beside = own.columns(columns, data)
        output = output - own.volts(columns, data)
    table = analyse(linear, data.rows.beside(beside), output, beside.shape[1])
    covariance, df = errors_of(linear, columns, output, data.replicate_index, table)
    if own is not None and df != linear.df:  # replications have no error of the temperature coefficients
        covariance = covariance + carried @ own.covariance @ carried.T
    parameters: AttitudeParameters | NoRollParameters
    if data.has_roll:
        axis = nominal_axis(sensor, linear.coefficients, data.axes)
        model = f"attitude-{'xyz'[axis]}"
        parameters = attitude_parameters(axis, linear.coefficients, covariance)
    else:
        model = "attitude-no-roll"
        parameters = no_roll_parameters(linear.coefficients, covariance)
    return AttitudeFit(
        sensor=sensor,
        model=model,
        linear=linear,
        parameters=parameters,
        parameters_df=df,
        replication=table,
        pitch_range_deg=(float(data.pitch_deg.min()), float(data.pitch_deg.max())),
        roll_range_deg=(float(data.roll_deg.min()), float(data.roll_deg.max())),
        temperature=own,
        degC=_temperatures(data),
        model_error=_model_error(parameters, linear, columns, data.point, table),
    )


def _temperatures(data: AttitudeData) -> tuple[float, float, float] | None:
    degC = data.sensor_temperature_degC
    return None if degC is None else (float(degC.min()), float(np.mean(degC)), float(degC.max()))


def at_temperature(table: Mapping[str, JsonValue], degC: float | None) -> dict[str, JsonValue]:
    """A parameter table with the reference temperature of every parameter."""
    return {name: {**row, "at_degC": degC} if isinstance(row, dict) else row for name, row in table.items()}


def _model_error(
    parameters: AttitudeParameters | NoRollParameters,
    linear: LinearFit,
    columns: FloatArray,
    point: IntArray,
    table: Replication,
) -> dict[str, float] | None:
    """Possible changes of parameters by a model error as large as the lack of fit; None without significant lack of
    fit.
    """
    if not lacks_fit(table):
        return None
    reach = reach_of_misfit(columns, point, table.sigma_bias)
    if isinstance(parameters, NoRollParameters):
        return moved_by(no_roll_parameters(linear.coefficients, reach))
    names = ("b_V", "S_V", "Omega_deg", "A_deg")
    moved = moved_by(attitude_parameters(parameters.axis, linear.coefficients, reach))
    return {name: value for name, value in moved.items() if name in names}


def moved_by(reach: AttitudeParameters | NoRollParameters) -> dict[str, float]:
    """Possible change of each parameter by a model error, from parameters with that covariance."""
    names = ("b_V", "S_V", "phi_deg") if isinstance(reach, NoRollParameters) else ("b_V", "S_V", "Omega_deg", "A_deg")
    moved = dict(zip(names, reach.stderr.tolist(), strict=True))
    if isinstance(reach, AttitudeParameters):
        axis = np.sqrt(np.diag(reach.m_covariance)).tolist()
        moved |= dict(zip(("mx_V", "my_V", "mz_V"), axis, strict=True))
    return {name: value for name, value in moved.items() if np.isfinite(value)}


def drifting(table: Replication) -> bool:
    """Whether the joint drift test of a Table 2 is significant at 5 %."""
    return bool(table.drift.p < _DRIFTS)


def drifting_together(tables: Sequence[Replication]) -> bool:
    """Whether the sensors of a package drift between replications: their joint drift tests together at 5 %.

    What is inferred needs all sensors, so a false alarm of one is one of all. Bonferroni's bound holds however their
    errors are correlated, such as by the head that moves all of them.
    """
    return any(table.drift.p * len(tables) < _DRIFTS for table in tables)


def errors_of(
    fit: LinearFit, columns: FloatArray, output: FloatArray, replicate: IntArray, table: Replication
) -> tuple[FloatArray, int]:
    """Covariance of the coefficients and its degrees of freedom: from the replications if they drift.

    Args:
        fit: the model, (k,) coefficients.
        columns: (n, k) its rows.
        output: (n,) volts, without other fitted effects.
        replicate: (n,) replication, from 0.
        table: Table 2 of the fit.
    """
    between = between_replications(columns, output, replicate, fit) if drifting(table) else None
    return between or (fit.covariance, fit.df)


def table_2(r: Replication, S_V: float) -> dict[str, JsonValue]:
    """The columns of Table 2 as JSON values: sigmas in volts, and in degrees (`_deg`) as in the paper."""
    sigmas = {name: getattr(r, name) for name in (*_SIGMAS, "sigma_pr")}
    table: dict[str, JsonValue] = {name: if_finite(value) for name, value in sigmas.items()}
    table |= {f"{name}_deg": if_finite(sigma_deg(value, S_V)) for name, value in sigmas.items()}
    table |= {
        "T_bias": if_finite(r.bias.value),
        "F_bias_95": if_finite(r.bias.limit_95),
        "p_bias": if_finite(r.bias.p),
        "T_bias_blind": None if r.blind is None else r.blind.sentence,
        "df_bias": [r.bias.df_above, r.bias.df_below],
        "T_b": if_finite(r.drift_b.value),
        "T_S": if_finite(r.drift_S.value),
        "F_bS_95": if_finite(r.drift_b.limit_95),
        "p_b": if_finite(r.drift_b.p),
        "p_S": if_finite(r.drift_S.p),
        "df_bS": [r.drift_b.df_above, r.drift_b.df_below],
        "T_drift": if_finite(r.drift.value),
        "F_drift_95": if_finite(r.drift.limit_95),
        "p_drift": if_finite(r.drift.p),
        "df_drift": [r.drift.df_above, r.drift.df_below],
    }
    return table


def parameter_table(p: AttitudeParameters | NoRollParameters, df: float) -> dict[str, JsonValue]:
    """Estimate, standard error, degrees of freedom and 95 % interval of every parameter, by name.

    A coning angle within `DIRECTION_KNOWN` standard deviations of zero has no errors, nor has its azimuth. The
    sensitive axis (mx_V, my_V, mz_V, volts per g in package axes) always has errors.
    """
    if isinstance(p, NoRollParameters):
        return _rows(("b_V", "S_V", "phi_deg"), (p.b_V, p.S_V, p.phi_deg), p.stderr, p.intervals(df), df)
    names, axes = ("b_V", "S_V", "Omega_deg", "A_deg"), ("mx_V", "my_V", "mz_V")
    axis_error = np.sqrt(np.diag(p.m_covariance))
    reach = t_limit(0.95, df) * axis_error
    return _rows(names, (p.b_V, p.S_V, p.Omega_deg, p.A_deg), p.stderr, p.intervals(df), df) | _rows(
        axes, p.m_V, axis_error, list(zip(p.m_V - reach, p.m_V + reach, strict=True)), df
    )


def temperature_table(temperature: Temperature | None, S_V: float, df: int) -> dict[str, JsonValue]:
    """Estimates and intervals of the temperature terms, per degC above the reference; {} without."""
    if temperature is None:
        return {}
    unit = 1e6 * np.array([1.0, 1.0 / S_V])
    values, errors = temperature.coefficients * unit, np.sqrt(np.diag(temperature.covariance)) * unit
    reach = t_limit(0.95, df) * errors
    intervals = list(zip(values - reach, values + reach, strict=True))
    return _rows(("dbdT_uV_per_degC", "dSdT_ppm_per_degC"), values, errors, intervals, df)


def _rows(
    names: Sequence[str],
    values: Sequence[float] | FloatArray,
    errors: FloatArray,
    intervals: Sequence[Interval | None],
    df: float,
) -> dict[str, JsonValue]:
    return {
        name: {
            "estimate": if_finite(value),
            "stderr": None if interval is None else if_finite(error),
            "df": df,
            "interval95": None if interval is None else [if_finite(end) for end in interval],
        }
        for name, value, error, interval in zip(names, values, errors, intervals, strict=True)
    }


def coefficient_table(fit: LinearFit) -> dict[str, JsonValue]:
    """Estimate, standard error and degrees of freedom of every coefficient, by column name."""
    return {
        name: {"estimate": float(value), "stderr": if_finite(float(error)), "df": fit.df}
        for name, value, error in zip(fit.names, fit.coefficients, fit.stderr, strict=True)
    }


def fit_all(
    data: AttitudeData, *, temperature: bool = False, at_degC: float | None = None
) -> Mapping[str, AttitudeFit]:
    """`fit_attitude` for every output."""
    return {s: fit_attitude(data, s, temperature=temperature, at_degC=at_degC) for s in data.sensors}
