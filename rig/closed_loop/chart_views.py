"""What is particular to charting each kind of sensor: parameters, range of use, and what they do to the output."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fitter.arrays import FloatArray
from fitter.history.charted import Charted
from fitter.quantiles import t_limit
from procedures.attitude.history import AttitudeCharted, Calibrated, attitude_charted
from procedures.general.history import curve_charted
from procedures.general.infer.curve import CurveCalibration
from procedures.pressure.fit.calibration import PressureFit
from procedures.pressure.history import pressure_charted
from procedures.unused import unit_of

_NO_ROLL = "attitude-no-roll"
_PITCHES, _ROLLS = 5, 12
"""Attitudes that the error of the output is bounded at: its extremes lie on this grid or close by."""


@dataclass(frozen=True, eq=False)
class View:
    """One sensor; attributes as of `rig.closed_loop.chart.SensorChart`.

    Attributes:
        rows: (H, q) what a unit of each charted parameter adds to the output over the range of use.
        interval: half-width of the 95 % interval of one reading, at its widest.
        remarks: what a reader should know.

    """

    charted: Charted
    rows: FloatArray
    model: str
    unit: str
    usage: tuple[float, float]
    usage_words: str
    interval: float
    remarks: Sequence[str] = ()


def of_attitude(every: Sequence[Calibrated], years: FloatArray, usage_deg: float | None) -> View:
    """An attitude sensor: at m calibrations, (m,) years since the first, used within +- `usage_deg` of pitch."""
    charted, last = attitude_charted(every, years), every[-1]
    (low, high), remarks = last.pitch_range_deg, []
    usage = (low, high) if usage_deg is None else (-usage_deg, usage_deg)
    if usage[0] < low - 1e-9 or usage[1] > high + 1e-9:
        remarks.append(f"+-{usage_deg:g} deg is more than was calibrated last ({low:g} to {high:g} deg)")
    if not charted.replicated:
        remarks.append(
            "no calibration has two replications that can be fitted alone; errors within calibrations are those of the "
            "residuals, and too small if anything drifted during one"
        )
    rolls = np.arange(_ROLLS) * (360.0 / _ROLLS) if last.model != _NO_ROLL else np.zeros(1)
    pitch, roll = (angle.ravel() for angle in np.meshgrid(np.linspace(*usage, _PITCHES), rolls))
    return View(
        charted=charted,
        rows=charted.output_rows(pitch, roll),
        model=last.model,
        unit="deg",
        usage=usage,
        usage_words=f"pitch {usage[0]:g} to {usage[1]:g} deg",
        interval=_interval_deg(last, charted, charted.output_rows(pitch, roll)),
        remarks=remarks,
    )


def _interval_deg(last: Calibrated, charted: AttitudeCharted, rows: FloatArray) -> float:
    """Half-width of the 95 % prediction interval of one reading by the last calibration, at its widest (eq. 73)."""
    rows = rows @ charted.directions
    widest = float(np.einsum("hk,kl,hl->h", rows, last.shape, rows).max())
    one = np.degrees(1.0 / charted.sensitivity) ** 2
    return t_limit(0.95, last.df_sigma) * last.sigma_V * float(np.sqrt(one + widest))


def of_curve(every: Sequence[CurveCalibration], years: FloatArray) -> View:
    """A column of tables of any kind: at m calibrations, (m,) years since the first."""
    charted, last = curve_charted(every, years), every[-1]
    plots = any(len(fit.variances) > 1 for fit in every)
    return View(
        charted=charted,
        rows=charted.rows,
        model=str(last.formula),
        unit=unit_of(last.response) or last.response,
        usage=(charted.low, charted.high),
        usage_words=f"{last.variable} {charted.low:g} to {charted.high:g}",
        interval=charted.interval,
        remarks=["the calibrations' whole plots are taken to be of one design"] if plots else [],
    )


def of_pressure(every: Sequence[PressureFit], years: FloatArray) -> View:
    """A pressure transducer: at m calibrations, (m,) years since the first."""
    charted = pressure_charted(every, years)
    sensor, sse = charted.centre_degC
    return View(
        charted=charted,
        rows=charted.output_rows(),
        model=str(every[-1].formula),
        unit="psi",
        usage=(0.0, charted.highest_psia),
        usage_words=f"0 to {charted.highest_psia:g} psia at {sensor:.3g} degC (sensor) and {sse:.3g} degC (SSE)",
        interval=charted.interval_psi,
    )
