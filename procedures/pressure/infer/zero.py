"""Readings near zero pressure in flight: their correction, its error, and its plausibility.

A zero is read at a pressure P_0, in vacuum or close to it: V_0 - x(P_0, T_0) b estimates the common error of the
readings of its whole plot. Zeros of several whole plots are independent: their mean estimates the transducer's own
offset, and a flight reading has its own whole-plot error.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.errors import FitError
from rig.fitter.quantiles import t_tail
from rig.procedures.pressure.fit import PressureCalibration

FARTHEST = 0.2
"""Highest pressure of a zero, relative to the highest calibrated; above, errors of the slope are relevant."""

BELOW = 0.02
"""Lowest pressure of a zero below 0, relative to the highest calibrated: possible error of a gauge in vacuum."""

IMPLAUSIBLE = 0.001
"""Probability below which a zero is implausible for the calibrated transducer."""


@dataclass(frozen=True)
class Zero:
    """The output read in one sitting near P = 0.

    Attributes:
        bridge_mV: the reading, or the mean of several.
        sensor_temperature_degC: then.
        sse_temperature_degC: then.
        readings: number of readings of the mean.
        pressure_psia: its pressure.
        pressure_sd_psia: standard deviation of that pressure; 0 for exact.
        scatter_mV: standard deviation of the readings about their mean: the part of the subplot error that averages.
            None: each reading has its own subplot error.
    """

    bridge_mV: float
    sensor_temperature_degC: float
    sse_temperature_degC: float
    readings: int = 1
    pressure_psia: float = 0.0
    pressure_sd_psia: float = 0.0
    scatter_mV: float | None = None

    def __post_init__(self) -> None:
        if not np.all(np.isfinite([self.bridge_mV, self.sensor_temperature_degC, self.sse_temperature_degC])):
            raise FitError("the zero reading is not a finite number")
        if self.readings < 1:
            raise FitError(f"a zero cannot be the mean of {self.readings} readings")
        if not np.isfinite(self.pressure_psia):
            raise FitError("the pressure of the zero is not a finite number")
        if not (np.isfinite(self.pressure_sd_psia) and self.pressure_sd_psia >= 0.0):
            raise FitError("the standard deviation of the zero's pressure is no positive number")

    def columns(self, calibration: PressureCalibration) -> FloatArray:
        """(1, k) row of the model at this zero."""
        return calibration.formula.columns(self._at)[1]

    def variance(self, calibration: PressureCalibration) -> tuple[FloatArray, FloatArray]:
        """Variance (1,) of the mean within its whole plot, mV^2, and its gradient (1, p) by the errors' parameters.

        Readings of one sitting share the error of the pressure's setting, and only their own scatter averages: if
        scatter^2 is less than the subplot variance s^2, only it is divided by their number. If it is more, there was a
        change during the sitting, and it replaces s^2.
        """
        variance, gradient = calibration.errors.of_reading(np.array([self.pressure_psia]), new_whole_plot=False)
        if self.scatter_mV is None:
            variance, gradient = variance / self.readings, gradient / self.readings
        else:
            averages = 1.0 - 1.0 / self.readings
            variance = np.maximum(variance, self.scatter_mV**2) - averages * self.scatter_mV**2
        slope = calibration.formula.derivative(self._at, "P") @ calibration.coefficients
        return variance + (slope * self.pressure_sd_psia) ** 2, gradient

    @property
    def _at(self) -> dict[str, FloatArray]:
        values = self.pressure_psia, self.sensor_temperature_degC, self.sse_temperature_degC
        return {name: np.array([value]) for name, value in zip(("P", "T_sensor", "T_SSE"), values, strict=True)}


@dataclass(frozen=True)
class Departure:
    """Deviation of a zero from the calibration at its pressure and temperatures.

    Attributes:
        off_mV: reading minus calibration.
        sd_mV: its expected standard deviation: whole-plot error, the reading's own error, and that of the coefficients.
        wholeplot_sd_mV: the part of the whole-plot error.
        df: degrees of freedom of `sd_mV`.
        p: probability of such a deviation by chance.
    """

    off_mV: float
    sd_mV: float
    wholeplot_sd_mV: float
    df: float
    p: float

    @property
    def deviations(self) -> float:
        """Deviation in standard deviations, without sign."""
        return abs(self.off_mV) / self.sd_mV

    @property
    def implausible(self) -> bool:
        """Whether the deviation is implausible by chance."""
        return self.p < IMPLAUSIBLE


def departure(calibration: PressureCalibration, zero: Zero) -> Departure:
    """Compare a zero with the calibration that it corrects."""
    row, errors = zero.columns(calibration), calibration.errors
    variance, gradient = zero.variance(calibration)
    shared, by_shared = errors.of_whole_plots(np.ones(1))
    variance = variance + shared + np.einsum("nk,kl,nl->n", row, calibration.covariance, row)
    gradient = gradient + by_shared + np.einsum("nk,pkl,nl->np", row, calibration.derivatives, row)
    df = float(errors.df(variance, gradient)[0])
    off, sd = zero.bridge_mV - float((row @ calibration.coefficients)[0]), float(np.sqrt(variance[0]))
    return Departure(off, sd, float(np.sqrt(errors.between_variance)), df, t_tail(off / sd, df))


def out_of_reach(calibration: PressureCalibration, zero: Zero) -> str:
    """Reason why this cannot be used as a zero of the calibration, "" if it can."""
    highest = calibration.ranges["P"][1]
    if zero.pressure_psia > FARTHEST * highest:
        return (
            f"the zero was read at {zero.pressure_psia:g} psia, which is far from zero: at most {FARTHEST * highest:g} "
            f"psia ({FARTHEST:.0%} of the highest pressure calibrated)"
        )
    if zero.pressure_psia < -BELOW * highest:
        return f"the zero was read at {zero.pressure_psia:g} psia, which no absolute pressure can be"
    return ""


@dataclass(frozen=True, eq=False)
class ZeroCorrection:
    """Correction of a reading by the zeros.

    Attributes:
        columns: (1, k) mean row of the model at the zeros.
        reading_mV: mean of their readings.
        variance: (1,) of the mean within the whole plots, mV^2.
        gradient: (1, p) of it.
        plots: number of whole-plot errors in the difference of a flight reading and the mean: 0 if one zero was read in
            the reading's own whole plot, otherwise 1 + 1/n for n zeros.
    """

    columns: FloatArray
    reading_mV: float
    variance: FloatArray
    gradient: FloatArray
    plots: float

    @staticmethod
    def of(calibration: PressureCalibration, zeros: Sequence[Zero]) -> ZeroCorrection:
        """From one zero read in the whole plot of the flight, or from several independent ones."""
        n = len(zeros)
        parts = [zero.variance(calibration) for zero in zeros]
        return ZeroCorrection(
            columns=np.mean([zero.columns(calibration) for zero in zeros], axis=0),
            reading_mV=float(np.mean([zero.bridge_mV for zero in zeros])),
            variance=np.asarray(sum(v for v, _ in parts) / n**2),
            gradient=np.asarray(sum(g for _, g in parts) / n**2),
            plots=0.0 if n == 1 else 1.0 + 1.0 / n,
        )
