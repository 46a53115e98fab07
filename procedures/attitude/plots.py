"""Residual plots: before and after, on one scale."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from procedures.attitude.parameters import SCALE, UNIT
from procedures.pictures import colour_scale, legend_below, side_by_side

Array = np.ndarray[Any, np.dtype[np.float64]]

_MARKS = "osD^v<>ph*"


@dataclass(frozen=True)
class Picture:
    """Plotted values of one sensor.

    Attributes:
        pitch_deg: (n,) setpoints.
        roll_deg: (n,) setpoints.
        elapsed_h: (n,) hours since the start of the run.
        temperature_degC: (n,) at the sensor, None if it was not recorded.
        replicate: (n,) number of the pass over the design.
        before_deg: (n,) residual of the declared model.
        after_deg: (n,) residual with the effects found.
        interval_deg: half-width of the 95 % prediction interval before and after, one number each.
    """

    pitch_deg: Array
    roll_deg: Array
    elapsed_h: Array
    temperature_degC: Array | None
    replicate: np.ndarray[Any, np.dtype[np.int64]]
    before_deg: Array
    after_deg: Array
    interval_deg: tuple[float, float]


def residuals_against(picture: Picture, x: Array, label: str, *, legend: bool) -> Figure:
    """Residuals before and after over one variable, with a colour for each replication, and a legend on request."""
    figure, axes = side_by_side(3.2)
    for axis, residual, half, title in (
        (axes[0], picture.before_deg, picture.interval_deg[0], "before: declared model"),
        (axes[1], picture.after_deg, picture.interval_deg[1], "after: with the effects found"),
    ):
        _by_replication(axis, x, residual, picture.replicate)
        for side in (-half, half):
            axis.axhline(side * SCALE, color="0.35", linewidth=0.9, linestyle="-.")
        axis.set_title(title, fontsize=9)
        axis.set_xlabel(label, fontsize=9)
    axes[0].set_ylabel(f"residual / {UNIT}", fontsize=9)
    if legend:
        handles, labels = axes[0].get_legend_handles_labels()
        legend_below(figure, handles, labels, 10, markerscale=2)
    bound = 1.15 * SCALE * float(np.percentile(np.abs(picture.before_deg), 99.8))
    axes[0].set_ylim(-bound, bound)
    return figure


def _by_replication(axis: Axes, x: Array, residual: Array, replicate: np.ndarray[Any, np.dtype[np.int64]]) -> None:
    for i, r in enumerate(np.unique(replicate)):
        rows = replicate == r
        axis.plot(
            x[rows],
            residual[rows] * SCALE,
            _MARKS[i % len(_MARKS)],
            markersize=2.2,
            alpha=0.55,
            label=f"replication {r}",
        )
    axis.grid(color="0.9", linewidth=0.6)
    axis.tick_params(labelsize=8)
    axis.axhline(0, color="0.5", linewidth=0.7)


def residual_map(picture: Picture) -> Figure:
    """Mean residual over pitch and roll, before and after, on one colour scale."""
    figure, axes = side_by_side(2.9)
    pitch, i = np.unique(np.round(picture.pitch_deg, 3), return_inverse=True)
    roll, j = np.unique(np.round(picture.roll_deg, 3), return_inverse=True)
    shape = (len(roll), len(pitch))
    cell = j * len(pitch) + i
    count = np.bincount(cell, minlength=shape[0] * shape[1])
    means = []
    for residual in (picture.before_deg, picture.after_deg):
        total = np.bincount(cell, residual, minlength=shape[0] * shape[1])
        with np.errstate(invalid="ignore"):
            means.append((SCALE * total / np.where(count, count, np.nan)).reshape(shape))
    bound = float(np.nanmax(np.abs(means[0])))
    for axis, mean, title in zip(axes, means, ("before", "after"), strict=True):
        mesh = axis.pcolormesh(pitch, roll, mean, vmin=-bound, vmax=bound, cmap="RdBu_r", shading="nearest")
        axis.set_title(f"mean residual, {title}", fontsize=9)
        axis.set_xlabel("pitch / deg", fontsize=9)
        axis.tick_params(labelsize=8)
    axes[0].set_ylabel("roll / deg", fontsize=9)
    colour_scale(figure, mesh, UNIT)
    return figure
