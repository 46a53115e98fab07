"""Calibrations of an attitude sensor as charted values.

The error within a calibration is not that of its pooled fit but that from its replications
(`rig.fitter.replication.between_replications`).

Of what was kept, the JSON of `fit_attitude` and `calibrate_package`, replications one by one are not known, but the
mean squares between them of offset and sensitivity (sigma_b, sigma_S) and of all parameters together; the last stands
for how the sensitive axis turns.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.errors import FitError
from rig.fitter.history import Charted, Series
from rig.fitter.replication import between_replications
from rig.procedures.attitude.data import AttitudeData
from rig.procedures.attitude.fit import fit_attitude
from rig.procedures.attitude.infer import AttitudeCalibration, SensorModel
from rig.procedures.attitude.model import (
    AXES,
    COLUMNS,
    attitude_columns,
    attitude_parameters,
    no_roll_parameters,
    sensitive_axis,
)


@dataclass(frozen=True, eq=False)
class Calibrated:
    """One sensor in one calibration.

    Attributes:
        model: "attitude-x", "attitude-y", "attitude-z" or "attitude-no-roll".
        coefficients: (k,) of `rig.procedures.attitude.model.COLUMNS`, V.
        shape: (k, k) covariance of the coefficients for readings of unit variance, (X'X)^-1.
        covariance: (k, k) of the coefficients from the variation between replications, V^2.
        df: its degrees of freedom.
        replicated: whether the covariance is from replications; without replications it is from the residuals.
        sigma_V: standard error of one reading.
        df_sigma: its degrees of freedom.
        pitch_range_deg: lowest and highest pitch calibrated.
        warmth: temperature dependence of the coefficients, if the declared model has it; they are those at its
            reference.
    """

    model: str
    coefficients: FloatArray
    shape: FloatArray
    covariance: FloatArray
    df: float
    replicated: bool
    sigma_V: float
    df_sigma: float
    pitch_range_deg: tuple[float, float]
    warmth: Warmth | None = None

    def at(self, degC: float) -> Calibrated:
        """This calibration at another sensor temperature; unchanged if the declared model has no temperature."""
        if self.warmth is None:
            return self
        by = degC - self.warmth.reference_degC
        return replace(
            self,
            coefficients=self.coefficients + by * self.warmth.per_degC,
            covariance=self.covariance + by**2 * self.warmth.covariance,
            warmth=replace(self.warmth, reference_degC=degC),
        )


@dataclass(frozen=True, eq=False)
class Warmth:
    """Temperature dependence of coefficients.

    Attributes:
        reference_degC: reference temperature.
        per_degC: (k,) V/degC.
        covariance: (k, k) of it.
    """

    reference_degC: float
    per_degC: FloatArray
    covariance: FloatArray


def calibrated(data: AttitudeData, sensor: str, *, temperature: bool = False) -> Calibrated:
    """Calibrate one sensor.

    Args:
        data: the run.
        sensor: name of the output.
        temperature: whether offset and sensitivity depend on the sensor's temperature in the declared model.

    Raises:
        KeyError: `data` has no such output.
        rig.fitter.linear.RankError: the points do not determine the model.
        FitError: the output never changes, there are no degrees of freedom for error, or there is no temperature.
    """
    fit = fit_attitude(data, sensor, temperature=temperature)
    shape = fit.linear.root @ fit.linear.root.T
    h, output, warmth = fit.columns(data.pitch_deg, data.roll_deg), data.outputs[sensor], None
    if fit.temperature is not None:
        output = output - fit.temperature.volts(h, data)
        turn = np.zeros((h.shape[1], 2))
        turn[0, 0], turn[1:, 1] = 1.0, fit.temperature.direction
        per_degC = turn @ fit.temperature.coefficients
        warmth = Warmth(fit.temperature.reference_degC, per_degC, turn @ fit.temperature.covariance @ turn.T)
    between = between_replications(h, output, data.replicate_index, fit.linear)
    if between is None and not fit.linear.df:
        raise FitError(f"{sensor}: as many points as coefficients, once each, leave no error to chart against")
    covariance, df = between or (fit.linear.covariance, fit.linear.df)
    return Calibrated(
        model=fit.model,
        coefficients=fit.linear.coefficients,
        shape=shape,
        covariance=covariance,
        df=float(df),
        replicated=between is not None,
        sigma_V=fit.linear.sigma,
        df_sigma=float(fit.linear.df),
        pitch_range_deg=fit.pitch_range_deg,
        warmth=warmth,
    )


@dataclass(frozen=True, eq=False)
class AttitudeCharted(Charted):
    """Offset, sensitivity along the mean sensitive axis, and rotation of that axis.

    Attributes:
        directions: (q, k) derivatives of the charted parameters by the coefficients.
        axis: (3, q) derivatives of the sensitive axis times sensitivity by them, V/g.
    """

    directions: FloatArray
    axis: FloatArray

    def output_rows(self, pitch_deg: FloatArray, roll_deg: FloatArray) -> FloatArray:
        """(H, q) derivative of the output, degrees, by each quantity at (H,) attitudes."""
        h = attitude_columns(pitch_deg, roll_deg)
        gravity = np.column_stack([h[:, 1], -h[:, 2], -h[:, 3]])
        volts = gravity @ self.axis
        volts[:, 0] += 1.0
        return np.asarray(np.degrees(volts / self.sensitivity))


def attitude_charted(calibrations: Sequence[Calibrated], years: FloatArray) -> AttitudeCharted:
    """Charted parameters of one sensor.

    The direction of the sensitive axis is charted as Omega cos A and Omega sin A: linear, and regular at Omega = 0,
    where A is undefined. Variances within are pooled over calibrations, in proportion to (X'X)^-1.

    Args:
        calibrations: m of them, in order of time.
        years: (m,) since the first.

    Raises:
        FitError: the calibrations are of different models, or fewer than two.
    """
    models = sorted({c.model for c in calibrations})
    if len(models) > 1:
        raise FitError(f"calibrations of different models cannot be charted together: {', '.join(models)}")
    model = models[0]
    coefficients = np.array([c.coefficients for c in calibrations])
    to_axis = np.column_stack([sensitive_axis(unit) for unit in np.eye(coefficients.shape[1])])
    axes = coefficients @ to_axis.T
    mean, S = axes.mean(axis=0), float(np.linalg.norm(axes.mean(axis=0)))
    along, *square = _basis(model, mean / S)
    turns = _turns(model, mean)
    directions = [np.eye(len(to_axis.T))[0], along @ to_axis, *(np.degrees(each @ to_axis / S) for each in square)]
    constants = [0.0, 0.0, *(at for _, at in turns)]
    shown, parameters = _display(model, coefficients)
    gradients = [_gradients(model, axis, to_axis) for axis in axes]
    variances = [_within(calibrations, [g[i] for g in gradients])[0] for i in range(len(shown))]
    return AttitudeCharted(
        names=("b_V", "S_V", *(name for name, _ in turns)),
        series=tuple(
            Series(years, constant + coefficients @ d, *_within(calibrations, [d] * len(years)))
            for constant, d in zip(constants, directions, strict=True)
        ),
        shown=shown,
        parameters=parameters,
        stderr=np.sqrt(np.column_stack(variances)),
        sensitivity=S,
        replicated=any(c.replicated for c in calibrations),
        variance_of=lambda weights: _within(calibrations, [weights @ np.array(directions)] * len(years)),
        directions=np.array(directions),
        axis=np.column_stack([np.zeros(3), along, *(each * np.radians(S) for each in square)]),
    )


def _within(calibrations: Sequence[Calibrated], directions: Sequence[FloatArray]) -> tuple[FloatArray, float]:
    """(m,) variance within of `directions` @ coefficients, one each, and its degrees of freedom, pooled.

    If some calibrations have replications, their variance is used for all.
    """
    replicated = any(c.replicated for c in calibrations)
    unit = np.array([d @ c.shape @ d for c, d in zip(calibrations, directions, strict=True)])
    own = np.array([d @ c.covariance @ d for c, d in zip(calibrations, directions, strict=True)])
    df = np.array([c.df if c.replicated or not replicated else 0.0 for c in calibrations])
    return unit * float(df @ (own / unit) / df.sum()), float(df.sum())


def _basis(model: str, along: FloatArray) -> FloatArray:
    """(k - 1, 3) unit vectors: along the sensitive axis, and square to it towards the next axes of the package."""
    if model == "attitude-no-roll":
        return np.array([along, [-along[2], 0.0, along[0]]])
    i = AXES[model[-1]]
    towards = np.eye(3)[(i + 1) % 3]
    second = towards - (towards @ along) * along
    second /= np.linalg.norm(second)
    return np.array([along, second, np.cross(along, second)])


def _turns(model: str, mean: FloatArray) -> list[tuple[str, float]]:
    """Name of each rotation of the sensitive axis, and its value at the mean."""
    if model == "attitude-no-roll":
        return [("phi_deg", float(np.degrees(np.arctan2(mean[2], mean[0]))))]
    i = AXES[model[-1]]
    j, k = mean[(i + 1) % 3], mean[(i + 2) % 3]
    across = np.hypot(j, k)
    scale = float(np.degrees(np.arctan2(across, mean[i]))) / across if across > 0 else 0.0
    return [("Omega_cos_A_deg", float(scale * j)), ("Omega_sin_A_deg", float(scale * k))]


def _display(model: str, coefficients: FloatArray) -> tuple[tuple[str, ...], FloatArray]:
    """Names and (m, p) values of the paper's parameters."""
    nothing = np.zeros((coefficients.shape[1],) * 2)
    if model == "attitude-no-roll":
        flat = [no_roll_parameters(c, nothing) for c in coefficients]
        return ("b_V", "S_V", "phi_deg"), np.array([[p.b_V, p.S_V, p.phi_deg] for p in flat])
    full = [attitude_parameters(AXES[model[-1]], c, nothing) for c in coefficients]
    return ("b_V", "S_V", "Omega_deg", "A_deg"), np.array([[p.b_V, p.S_V, p.Omega_deg, p.A_deg] for p in full])


def _gradients(model: str, axis: FloatArray, to_axis: FloatArray) -> list[FloatArray]:
    """(k,) gradient of each of the paper's parameters by the coefficients, at one calibration."""
    S = float(np.linalg.norm(axis))
    along = axis / S
    first = np.eye(to_axis.shape[1])[0]
    if model == "attitude-no-roll":
        return [first, along @ to_axis, np.degrees(_basis(model, along)[1] @ to_axis / S)]
    i = AXES[model[-1]]
    j, k = (i + 1) % 3, (i + 2) % 3
    across = float(np.hypot(along[j], along[k]))
    outward = np.zeros(3)
    outward[[j, k]] = (along[j] / across, along[k] / across) if across > 0 else (1.0, 0.0)
    by_omega = along[i] * outward - across * np.eye(3)[i]
    by_azimuth = np.cross(np.eye(3)[i], outward)
    to_A = np.degrees(by_azimuth @ to_axis / (S * across)) if across > 0 else np.full(len(COLUMNS), np.nan)
    return [first, along @ to_axis, np.degrees(by_omega @ to_axis / S), to_A]


def calibrated_from(content: Mapping[str, Any]) -> dict[str, Calibrated]:
    """Every sensor of a calibration file, by output column.

    Args:
        content: with "sensors", each as `AttitudeFit.to_dict`, and "calibration", as `AttitudeCalibration.to_dict`.

    Raises:
        FitError: the content is invalid, or has no error for charts.
    """
    package = AttitudeCalibration.from_dict(content["calibration"])
    keep = list(range(len(COLUMNS))) if package.roll else [0, 1, 3]
    found, start = {}, 0
    for sensor in package.sensors:
        size, at = sensor.coefficients.size, start
        block = package.covariance[start : start + size, start : start + size][np.ix_(keep, keep)]
        start += size
        try:
            fitted = content["sensors"][sensor.name]
            replications = fitted["df_bS"][0]
            shape = block / sensor.sigma_V**2
            replicated = replications > 0 and None not in (fitted["sigma_b"], fitted["sigma_S"], fitted["T_drift"])
            axis = sensor.coefficients[keep][1:]
            covariance = _between(fitted, shape, axis) if replicated else block
            found[sensor.name] = Calibrated(
                model=f"attitude-{sensor.axis}" if package.roll else "attitude-no-roll",
                coefficients=sensor.coefficients[keep],
                shape=shape,
                covariance=covariance,
                df=float(replications if replicated else sensor.df),
                replicated=replicated,
                sigma_V=sensor.sigma_V,
                df_sigma=sensor.df,
                pitch_range_deg=package.pitch_range_deg,
                warmth=_warmth(sensor, package.reference_degC, package.covariance[at:start, at:start], keep),
            )
        except (KeyError, TypeError, IndexError) as problem:
            raise FitError(f"{sensor.name} lacks or garbles {problem} of its analysis of variance") from problem
    return found


def _warmth(
    sensor: SensorModel, reference_degC: float | None, covariance: FloatArray, keep: list[int]
) -> Warmth | None:
    """From the temperature terms of offset and sensitivity, if the sensor has them."""
    linear = {powers: row for row, powers in enumerate(((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)))}
    turn = np.zeros((len(COLUMNS), len(sensor.terms)))
    for j, term in enumerate(sensor.terms):
        if term.degC == 1 and term.powers in linear:
            row = linear[term.powers]
            turn[row, j] = 1.0 if row < 2 else -1.0  # g_y and g_z are minus their columns
    if reference_degC is None or not np.any(turn):
        return None
    own = covariance[len(COLUMNS) :, len(COLUMNS) :]
    per_degC = turn @ sensor.coefficients[len(COLUMNS) :]
    return Warmth(reference_degC, per_degC[keep], (turn @ own @ turn.T)[np.ix_(keep, keep)])


def _between(fitted: Mapping[str, Any], shape: FloatArray, sensitivity: FloatArray) -> FloatArray:
    """(k, k) covariance from the variation between replications, with mean squares in place of one variance.

    Args:
        fitted: analysis of variance.
        shape: (k, k) (X'X)^-1.
        sensitivity: (k - 1,) coefficients after the offset.
    """
    k = len(shape)
    turn = np.eye(k)  # rows: offset, along the sensitivity, square to it
    turn[1:, 1:] = np.linalg.qr(np.column_stack([sensitivity, np.eye(k - 1)]))[0].T
    rest = fitted["T_drift"] * fitted["sigma_pr"] ** 2
    scale = np.sqrt(np.array([fitted["sigma_b"] ** 2, fitted["sigma_S"] ** 2, *[rest] * (k - 2)]))
    turned = scale[:, None] * (turn @ shape @ turn.T) * scale
    return np.asarray(turn.T @ turned @ turn)
