"""A figure for every effect that was found in a pressure transducer, before and after, over its own variable."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from fitter.linear import orthonormal
from fitter.trace.whole_plots.result import FoundPressureEffect
from rig.report.effect_plots import EffectView, effect_plot, noise_plot

if TYPE_CHECKING:
    from rig.closed_loop import WholePlotTraced

Array = np.ndarray[Any, np.dtype[np.float64]]

_VARIABLES = {
    "pressure_psia": ("pressure / psia", 1.0),
    "previous_pressure_psia": ("pressure before / psia", 1.0),
    "pressure_side": ("side of approach", 1.0),
    "sensor_temperature_degC": ("sensor temperature / degC", 1.0),
    "sse_temperature_degC": ("electronics temperature / degC", 1.0),
    "since_s": ("time in the whole plot / h", 1 / 3600.0),
    "elapsed_s": ("bench time / h", 1 / 3600.0),
}
"""Label and scale of the fields of the data that effects are looked at against."""


def effect_figures(traced: WholePlotTraced, name: str) -> dict[str, str]:
    """Base64 PNG for every effect and finding of one transducer, by its name.

    What varies within whole plots is shown less their means, which errors of their own hide; what varies between them,
    by the means.
    """
    data, found = traced.data, traced.trace.sensors[name]
    residual = found.after.residual_mV
    _, columns = traced.trace.formula.columns(data.table, traced.trace.formula.levels(data.table))
    basis = orthonormal(columns)
    first = np.unique(data.whole_plot_index, return_index=True)[1]
    figures = {}
    for effect in found.effects:
        x, label = _variable(traced, effect)
        rows = first if effect.stratum == "whole-plot" else np.flatnonzero(np.isfinite(x))
        if effect.stratum == "noise":
            figures[effect.effect] = noise_plot(x[rows], label, (residual - _means(traced, residual))[rows], "mV")
            continue
        contribution = effect.contribution_mV - basis @ (basis.T @ effect.contribution_mV)
        adds, left = (_shown(traced, values, effect.stratum)[rows] for values in (contribution, residual))
        figures[effect.effect] = effect_plot(EffectView(x[rows], label, adds, left, "mV"))
    return figures


def _shown(traced: WholePlotTraced, values: Array, stratum: str) -> Array:
    """(n,) what of values stands in the effect's stratum."""
    means = _means(traced, values)
    return means if stratum == "whole-plot" else values - means


def _variable(traced: WholePlotTraced, effect: FoundPressureEffect) -> tuple[Array, str]:
    name = effect.against if effect.against in _VARIABLES else "elapsed_s"
    label, scale = _VARIABLES[name]
    return np.asarray(getattr(traced.data, name), np.float64) * scale, label


def _means(traced: WholePlotTraced, values: Array) -> Array:
    """(n,) mean of the whole plot each reading is in."""
    index = traced.data.whole_plot_index
    return np.asarray((np.bincount(index, values) / np.bincount(index))[index])
