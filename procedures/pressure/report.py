"""The report of a trace in a pressure calibration: findings, error before and after, residuals."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from rig.procedures.evaluate.results import Page
from rig.procedures.evaluate.trace_page import trace_page
from rig.procedures.present.pictures import BEFORE_AFTER, colour_scale, dress, side_by_side
from rig.procedures.pressure.data import WholePlotData

if TYPE_CHECKING:
    from rig.procedures.evaluate.results import Traced
    from rig.procedures.pressure.trace import TransducerTrace, WholePlotTrace

Array = np.ndarray[Any, np.dtype[np.float64]]


@dataclass(frozen=True)
class Residuals:
    """Plotted values of one transducer.

    Attributes:
        data: settings and times of the readings.
        before_mV: (n,) residual of the declared model, including whole-plot errors.
        after_mV: (n,) the same with the effects found.
        sensitivity: mV/psi.
    """

    data: WholePlotData
    before_mV: Array
    after_mV: Array
    sensitivity: float

    @property
    def sides(self) -> tuple[Array, Array]:
        """Before and after."""
        return self.before_mV, self.after_mV


def within_whole_plots(residuals: Residuals) -> Figure:
    """Residuals minus their whole plot's mean over pressure, with a colour for each direction of approach."""
    data, means = residuals.data, [_less_means(residuals.data, side) for side in residuals.sides]
    figure, axes = side_by_side(3.2)
    for axis, left, title in zip(axes, means, BEFORE_AFTER, strict=True):
        for side, colour, label in ((1, "C0", "came from below"), (-1, "C1", "from above"), (0, "0.5", "first")):
            rows = data.pressure_side == side
            axis.plot(data.pressure_psia[rows], left[rows], "o", ms=3, alpha=0.6, color=colour, label=label)
        dress(axis, title, "pressure / psia")
        axis.set_xscale("log")
    axes[0].set_ylabel("within whole plots / mV", fontsize=9)
    axes[0].legend(fontsize=7, frameon=False, ncols=3)
    return figure


def reading_errors(residuals: Residuals) -> Figure:
    """Residuals over pressure as a percentage of reading, including whole-plot errors."""
    data = residuals.data
    figure, axes = side_by_side(3.2)
    nonzero = data.pressure_psia > 0
    for axis, side, title in zip(axes, residuals.sides, BEFORE_AFTER, strict=True):
        pressure = data.pressure_psia[nonzero]
        error = 100.0 * side[nonzero] / (residuals.sensitivity * pressure)
        axis.plot(pressure, error, "o", ms=3, alpha=0.6)
        dress(axis, title, "pressure / psia")
        axis.set_xscale("log")
        axis.set_yscale("symlog", linthresh=1.0)
    axes[0].set_ylabel("reading error / %", fontsize=9)
    return figure


def between_whole_plots(residuals: Residuals) -> Figure:
    """Whole plots' mean residuals in running order, coloured by sensor temperature."""
    data = residuals.data
    index, count = data.whole_plot_index, np.bincount(data.whole_plot_index)
    began = np.array([data.order[index == i].min() for i in range(len(count))])
    position = np.argsort(np.argsort(began)) + 1
    warmth = np.bincount(index, data.sensor_temperature_degC) / count
    figure, axes = side_by_side(2.9)
    for axis, side, title in zip(axes, residuals.sides, BEFORE_AFTER, strict=True):
        mean = np.bincount(index, side) / count
        dots = axis.scatter(position, mean, c=warmth, s=28, cmap="coolwarm", edgecolors="0.4", linewidths=0.4)
        dress(axis, title, "whole plot, in the order of running")
    axes[0].set_ylabel("mean residual / mV", fontsize=9)
    colour_scale(figure, dots, "sensor / degC")
    return figure


def _less_means(data: WholePlotData, side: Array) -> Array:
    index = data.whole_plot_index
    return np.asarray(side - (np.bincount(index, side) / np.bincount(index))[index])


def page_of(traced: Traced, data: WholePlotData, trace: WholePlotTrace) -> Page:
    """The report of a trace of these data."""
    return trace_page(
        traced,
        "rig.procedures.pressure",
        lambda name: _plots(name, data, trace.sensors[name]),
        float(np.ptp(data.elapsed_s)),
        whole_plots=len(data.whole_plots),
    )


def _plots(name: str, data: WholePlotData, found: TransducerTrace) -> list[dict[str, Any]]:
    residuals = Residuals(data, found.before.residual_mV, found.after.residual_mV, found.sensitivity)
    return [
        {"alt": f"{name}: reading error over pressure, before and after", "figure": reading_errors(residuals)},
        {"alt": f"{name}: residuals within whole plots over pressure", "figure": within_whole_plots(residuals)},
        {"alt": f"{name}: mean residual of each whole plot", "figure": between_whole_plots(residuals)},
    ]
