"""Pressure from a transducer's output in flight, by inverting its calibration, with an interval.

Without a zero every reading, and its interval, includes a whole-plot error. In vacuum, or near it, the output at a
pressure P_0 can be read: then V - V_0 = [x(P, T) - x(P_0, T_0)] b, in which that error cancels, but the zero's own
subplot error is added. Standard deviations follow from dV/dP (first order: the curvature over one of them is negligible
for a transducer with a usable sensitivity), intervals from Student's t with Satterthwaite's degrees of freedom for the
sum of all variances.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import special

from rig.fitter.arrays import FloatArray
from rig.fitter.errors import FitError
from rig.procedures.pressure.fit import PressureCalibration
from rig.procedures.pressure.infer.zero import Departure, Zero, ZeroCorrection, departure, out_of_reach

BEYOND = 0.02
"""Permitted distance of a value from the calibrated range, relative to its width: readbacks have errors, and the lowest
calibrated pressure is not quite vacuum.
"""

ONE_TEMPERATURE_DEGC = 1.0
"""A calibration with less variation of temperature was made at one temperature: it is valid within this
distance of it.
"""

STOOD_DEGC = 2.0
"""Temperatures within this of the zero's count as unchanged: the zero removes their error."""

_ITERATIONS, _TOLERANCE = 40, 1e-12
_CHUNK = 65536

MOVED = "temperatures are not those of the zero: the interval holds the error of changing them"
NO_ROOT = "no pressure gives this output"
BAD_READING = "not a finite number"


@dataclass(frozen=True, eq=False)
class Inferred:
    """Pressures, one for each reading; NaN with a reason in `flag` if undetermined.

    Attributes:
        pressure_psia: (n,).
        sd_psia: (n,) standard deviation.
        lo95_psia: (n,) 95 % interval.
        hi95_psia: (n,).
        df: (n,) degrees of freedom of `sd_psia`.
        flag: (n,) empty without problems.
        departures: of each zero from the calibration.
    """

    pressure_psia: FloatArray
    sd_psia: FloatArray
    lo95_psia: FloatArray
    hi95_psia: FloatArray
    df: FloatArray
    flag: NDArray[Any]
    departures: tuple[Departure, ...] = ()


def infer_pressure(
    calibration: PressureCalibration,
    bridge_mV: ArrayLike,
    sensor_temperature_degC: ArrayLike,
    sse_temperature_degC: ArrayLike,
    zero: Zero | Sequence[Zero] | None = None,
) -> Inferred:
    """Pressure of (n,) readings; temperatures are (n,) or one for all.

    Args:
        calibration: of the transducer.
        bridge_mV: its output.
        sensor_temperature_degC: temperature of the transducer.
        sse_temperature_degC: temperature of its electronics.
        zero: the output in or near vacuum, read since the last change of temperatures; None for none. Readings at
            temperatures further than `STOOD_DEGC` from its own are flagged, and their intervals include the error of a
            change of temperature. A return to the same temperatures after a change is not visible here: intervals are
            then too short. Several zeros are independent: each has its own whole plot, and so have the readings. A zero
            implausibly far from the calibration is flagged in every row.

    Raises:
        ValueError: shapes differ, or a zero was read outside the calibrated temperatures, or far from zero pressure.
    """
    given = [np.asarray(a, np.float64) for a in (bridge_mV, sensor_temperature_degC, sse_temperature_degC)]
    output, sensor, sse = (np.atleast_1d(a) for a in np.broadcast_arrays(*given))
    if output.ndim != 1:
        raise ValueError(f"readings are expected in one dimension, found shape {output.shape}")
    zeros = () if zero is None else (zero,) if isinstance(zero, Zero) else tuple(zero)
    for each in zeros:
        at_zero = np.array([each.sensor_temperature_degC]), np.array([each.sse_temperature_degC])
        outside = _temperature_flags(calibration, *at_zero)[0]
        if outside:
            raise FitError(f"the zero was read where the {outside}")
        if far := out_of_reach(calibration, each):
            raise FitError(far)
    parts = [
        _infer(calibration, output[i : i + _CHUNK], sensor[i : i + _CHUNK], sse[i : i + _CHUNK], zeros)
        for i in range(0, max(len(output), 1), _CHUNK)
    ]
    names = ("pressure_psia", "sd_psia", "lo95_psia", "hi95_psia", "df", "flag")
    found = Inferred(
        **{name: np.concatenate([getattr(part, name) for part in parts]) for name in names},
        departures=tuple(departure(calibration, each) for each in zeros),
    )
    for off in found.departures:
        if off.implausible:
            words = f"the zero is {off.deviations:.3g} standard deviations from the calibration"
            found.flag[:] = [f"{flag}; {words}" if flag else words for flag in found.flag]
    return found


def _infer(
    calibration: PressureCalibration, output: FloatArray, sensor: FloatArray, sse: FloatArray, zeros: Sequence[Zero]
) -> Inferred:
    flag = _temperature_flags(calibration, sensor, sse)
    flag[~np.isfinite(output)] = BAD_READING
    usable = flag == ""
    zero = ZeroCorrection.of(calibration, zeros) if zeros else None
    target = output if zero is None else output - zero.reading_mV + zero.columns @ calibration.coefficients
    pressure = np.full(len(output), np.nan)
    pressure[usable] = _root(calibration, target[usable], sensor[usable], sse[usable])
    flag[usable & np.isnan(pressure)] = NO_ROOT
    low, high = calibration.ranges["P"]
    room = BEYOND * (high - low)
    outside = (pressure < low - room) | (pressure > high + room)
    flag[outside] = f"pressure is outside the calibrated {low:g} to {high:g} psia"
    usable &= ~outside & np.isfinite(pressure)
    pressure[~usable] = np.nan
    moved = np.zeros(len(output), bool)
    if len(zeros) == 1:
        far = np.abs(sensor - zeros[0].sensor_temperature_degC), np.abs(sse - zeros[0].sse_temperature_degC)
        moved = usable & (np.maximum(*far) > STOOD_DEGC)
        flag[moved] = MOVED
    sd, df = np.full(len(output), np.nan), np.full(len(output), np.nan)
    if np.any(usable):
        at = pressure[usable], sensor[usable], sse[usable]
        variance, df[usable] = _variance(calibration, *at, zero, moved[usable])
        sd[usable] = np.sqrt(variance) / np.abs(_slope(calibration, *at))
    half = special.stdtrit(df, 0.975) * sd
    return Inferred(pressure, sd, pressure - half, pressure + half, df, flag)


def _variance(
    calibration: PressureCalibration,
    pressure: FloatArray,
    sensor: FloatArray,
    sse: FloatArray,
    zero: ZeroCorrection | None,
    moved: NDArray[np.bool_],
) -> tuple[FloatArray, FloatArray]:
    """Variance of V minus the model at the inferred pressure, mV^2 (n,), and its degrees of freedom (n,).

    A reading at other temperatures than the zero's (`moved`, (n,)) has another whole-plot error than the zero.
    """
    errors = calibration.errors
    variance, gradient = errors.of_reading(pressure, new_whole_plot=zero is None)
    h = _columns(calibration, pressure, sensor, sse)
    if zero is not None:
        shared, by_shared = errors.of_whole_plots(np.where(moved, 2.0, zero.plots))
        variance, gradient = variance + shared + zero.variance, gradient + by_shared + zero.gradient
        h = h - zero.columns
    variance = variance + np.einsum("nk,kl,nl->n", h, calibration.covariance, h)
    gradient = gradient + np.einsum("nk,pkl,nl->np", h, calibration.derivatives, h, optimize=True)
    return variance, errors.df(variance, gradient)


def _root(calibration: PressureCalibration, target: FloatArray, sensor: FloatArray, sse: FloatArray) -> FloatArray:
    """(n,) pressure at which the model gives `target`, on the branch of the calibrated range; NaN for none. By Newton's
    method from the middle of the range, with steps of at most half of it.
    """
    low, high = calibration.ranges["P"]
    middle, span = 0.5 * (low + high), high - low
    pressure = np.full(len(target), middle)
    branch = np.sign(_slope(calibration, pressure, sensor, sse))
    for _ in range(_ITERATIONS):
        model = _columns(calibration, pressure, sensor, sse) @ calibration.coefficients
        slope = _slope(calibration, pressure, sensor, sse)
        with np.errstate(divide="ignore", invalid="ignore"):
            step = np.nan_to_num(np.clip((target - model) / slope, -0.5 * span, 0.5 * span))
        pressure = pressure + step
        if np.all(np.abs(step) <= _TOLERANCE * span):
            break
    found = (np.abs(step) <= 1e-9 * span) & (np.sign(_slope(calibration, pressure, sensor, sse)) == branch)
    return np.where(found, pressure, np.nan)


def _temperature_flags(calibration: PressureCalibration, sensor: FloatArray, sse: FloatArray) -> NDArray[Any]:
    """(n,) defects of the temperatures, empty without.

    A temperature that is not in the formula counts too: its influence on the output was not calibrated.
    """
    flag = np.full(len(sensor), "", dtype=object)
    for name, label, values in (("T_SSE", "SSE", sse), ("T_sensor", "sensor", sensor)):
        low, high = calibration.ranges[name]
        room = BEYOND * (high - low)
        if name not in calibration.formula.names and high - low < ONE_TEMPERATURE_DEGC:
            room = ONE_TEMPERATURE_DEGC
        outside = ~((values >= low - room) & (values <= high + room))
        flag[outside] = f"{label} temperature is outside the calibrated {low:g} to {high:g} degC"
    return flag


def _columns(calibration: PressureCalibration, pressure: FloatArray, sensor: FloatArray, sse: FloatArray) -> FloatArray:
    return calibration.formula.columns({"P": pressure, "T_sensor": sensor, "T_SSE": sse})[1]


def _slope(calibration: PressureCalibration, pressure: FloatArray, sensor: FloatArray, sse: FloatArray) -> FloatArray:
    """(n,) dV/dP, mV/psi."""
    table = {"P": pressure, "T_sensor": sensor, "T_SSE": sse}
    return np.asarray(calibration.formula.derivative(table, "P") @ calibration.coefficients)
