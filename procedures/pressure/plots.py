"""Residual plots of a pressure transducer in whole plots, before and after, on one scale."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from procedures.pictures import colour_scale, side_by_side
from procedures.pressure.data import WholePlotData

Array = np.ndarray[Any, np.dtype[np.float64]]

_TITLES = ("before: declared model", "after: with the effects found")


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
    for axis, left, title in zip(axes, means, _TITLES, strict=True):
        for side, colour, label in ((1, "C0", "came from below"), (-1, "C1", "from above"), (0, "0.5", "first")):
            rows = data.pressure_side == side
            axis.plot(data.pressure_psia[rows], left[rows], "o", ms=3, alpha=0.6, color=colour, label=label)
        _dress(axis, "pressure / psia", title)
        axis.set_xscale("log")
    axes[0].set_ylabel("within whole plots / mV", fontsize=9)
    axes[0].legend(fontsize=7, frameon=False, ncols=3)
    return figure


def reading_errors(residuals: Residuals) -> Figure:
    """Residuals over pressure as a percentage of reading, including whole-plot errors."""
    data = residuals.data
    figure, axes = side_by_side(3.2)
    nonzero = data.pressure_psia > 0
    for axis, side, title in zip(axes, residuals.sides, _TITLES, strict=True):
        pressure = data.pressure_psia[nonzero]
        error = 100.0 * side[nonzero] / (residuals.sensitivity * pressure)
        axis.plot(pressure, error, "o", ms=3, alpha=0.6)
        _dress(axis, "pressure / psia", title)
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
    for axis, side, title in zip(axes, residuals.sides, _TITLES, strict=True):
        mean = np.bincount(index, side) / count
        dots = axis.scatter(position, mean, c=warmth, s=28, cmap="coolwarm", edgecolors="0.4", linewidths=0.4)
        _dress(axis, "whole plot, in the order of running", title)
    axes[0].set_ylabel("mean residual / mV", fontsize=9)
    colour_scale(figure, dots, "sensor / degC")
    return figure


def _less_means(data: WholePlotData, side: Array) -> Array:
    index = data.whole_plot_index
    return np.asarray(side - (np.bincount(index, side) / np.bincount(index))[index])


def _dress(axis: Axes, label: str, title: str) -> None:
    axis.set_title(title, fontsize=9)
    axis.set_xlabel(label, fontsize=9)
    axis.grid(color="0.9", linewidth=0.6)
    axis.tick_params(labelsize=8)
    axis.axhline(0, color="0.5", linewidth=0.7)
