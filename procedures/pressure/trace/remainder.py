"""The remainder in each stratum beyond pure error, and its place; reading error by pressure."""

from __future__ import annotations

import numpy as np

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.trace.engine.beside import View
from rig.fitter.trace.outcome import Finding, remains
from rig.procedures.pressure.data import WholePlotData

SAME_TEMPERATURE_DEGC = 2.0
"""Whole plots with closer temperatures are repeats: chambers are accurate to a degree, steps of designs are many
degrees.
"""


def repeated_readings(data: WholePlotData) -> IntArray:
    """(n,) group number of readings at one pressure in one whole plot."""
    level = data.pressure_levels[1]
    return _numbered(data.whole_plot_index * (1 + level.max()) + level)


def repeated_whole_plots(data: WholePlotData) -> IntArray:
    """(W,) group number of whole plots at one pair of temperatures."""
    index = data.whole_plot_index
    count = np.bincount(index)
    pairs = []
    for given in (data.sensor_temperature_degC, data.sse_temperature_degC):
        mean = np.bincount(index, given) / count
        order = np.argsort(mean)
        setting = np.empty(len(mean), np.int64)
        setting[order] = np.cumsum(np.diff(mean[order], prepend=mean[order[0]]) > SAME_TEMPERATURE_DEGC)
        pairs.append(setting)
    return _numbered(pairs[0] * (1 + pairs[1].max()) + pairs[1])


def strongest_pressure(view: View, data: WholePlotData, i: int) -> Finding:
    """The pressure with the largest residual of transducer `i` in a `view` within whole plots."""
    left, levels = view.outputs[i], data.pressure_levels
    sums, count = np.bincount(levels[1], left), np.bincount(levels[1])
    most = int(np.argmax(np.abs(sums) / np.sqrt(count)))
    plain = left * view.sigma[i] * view.white.errors[i].sd
    mean = float(np.mean(plain[levels[1] == most]))
    share = float(np.sum(sums**2 / count) / np.sum(left**2))
    return remains(f"within whole plots, most at {levels[0][most]:g} psia: {mean:+.2g} mV on average", share)


def strongest_whole_plot(view: View, data: WholePlotData, i: int) -> Finding:
    """The temperatures with the largest residual of transducer `i` in a `view` between whole plots."""
    left, repeats = view.outputs[i], repeated_whole_plots(data)
    sums, count = np.bincount(repeats, left), np.bincount(repeats)
    most = int(np.argmax(np.abs(sums) / np.sqrt(count)))
    rows = np.isin(data.whole_plot_index, np.flatnonzero(repeats == most))
    sensor, sse = (float(np.mean(t[rows])) for t in (data.sensor_temperature_degC, data.sse_temperature_degC))
    share = float(np.sum(sums**2 / count) / np.sum(left**2))
    return remains(f"between whole plots, most at {sensor:.0f} degC with electronics at {sse:.0f} degC", share)


def reading_error_pct(data: WholePlotData, residual: FloatArray, slope: FloatArray) -> dict[str, float | None]:
    """Largest residual at each nominal pressure over the pressure read, in percent; None at zero pressure.

    Args:
        data: the run.
        residual: (n,) of one transducer, including whole-plot errors, mV.
        slope: (n,) dV/dP there, mV/psi.
    """
    psia, level = data.pressure_levels
    positive = data.pressure_psia > 0
    with np.errstate(divide="ignore", invalid="ignore"):
        error = np.where(positive, np.abs(100.0 * residual / (slope * data.pressure_psia)), 0.0)
    largest = np.zeros(psia.size)
    np.maximum.at(largest, level, error)
    names = (f"{round(float(p), 3):g}" for p in psia)  # differences of levels are larger
    return {name: float(e) if p > 0 else None for name, p, e in zip(names, psia, largest, strict=True)}


def _numbered(code: IntArray) -> IntArray:
    return np.asarray(np.unique(code, return_inverse=True)[1], np.int64)
