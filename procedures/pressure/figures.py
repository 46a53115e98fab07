"""Plots of every effect found in a pressure transducer over its own variable."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.linear import orthonormal
from rig.fitter.trace.outcome import Figure
from rig.procedures.pressure.data import WholePlotData
from rig.procedures.pressure.trace import FoundPressureEffect, TransducerTrace, WholePlotTrace

_VARIABLES = {
    "pressure_psia": ("pressure / psia", 1.0),
    "previous_pressure_psia": ("pressure before / psia", 1.0),
    "pressure_side": ("side of approach", 1.0),
    "sensor_temperature_degC": ("sensor temperature / degC", 1.0),
    "sse_temperature_degC": ("electronics temperature / degC", 1.0),
    "since_s": ("time in the whole plot / h", 1 / 3600.0),
    "elapsed_s": ("bench time / h", 1 / 3600.0),
}
"""Label and scale of the fields of the data for plots of effects."""


def effect_figures(data: WholePlotData, trace: WholePlotTrace, found: TransducerTrace) -> Mapping[str, Figure]:
    """Plot data of every effect and finding about noise of one transducer, by its name.

    Effects within whole plots are shown with the means removed, because of the whole-plot errors; effects between whole
    plots by the means.
    """
    residual = found.after.residual_mV
    _, columns = trace.formula.columns(data.table, trace.formula.levels(data.table))
    basis = orthonormal(columns)
    first = np.unique(data.whole_plot_index, return_index=True)[1]
    figures = {}
    for effect in found.effects:
        x, label = _variable(data, effect)
        rows = first if effect.stratum == "whole-plot" else np.flatnonzero(np.isfinite(x))
        if effect.stratum == "noise":
            figures[effect.effect] = Figure(x[rows], label, (residual - _means(data, residual))[rows], None, "mV")
            continue
        contribution = effect.contribution_mV - basis @ (basis.T @ effect.contribution_mV)
        adds, left = (_shown(data, values, effect.stratum)[rows] for values in (contribution, residual))
        figures[effect.effect] = Figure(x[rows], label, left, adds, "mV")
    return figures


def _shown(data: WholePlotData, values: FloatArray, stratum: str) -> FloatArray:
    """(n,) part of values in the effect's stratum."""
    means = _means(data, values)
    return means if stratum == "whole-plot" else values - means


def _variable(data: WholePlotData, effect: FoundPressureEffect) -> tuple[FloatArray, str]:
    name = effect.against if effect.against in _VARIABLES else "elapsed_s"
    label, scale = _VARIABLES[name]
    return np.asarray(getattr(data, name), np.float64) * scale, label


def _means(data: WholePlotData, values: FloatArray) -> FloatArray:
    """(n,) mean of each reading's whole plot."""
    index = data.whole_plot_index
    return np.asarray((np.bincount(index, values) / np.bincount(index))[index])
