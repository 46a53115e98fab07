"""A shape without a name as a figure: a curve, or a few, with the band over the residual's means; or a surface."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from rig.procedures.present.pictures import colour_scale, dress, side_by_side

Array = np.ndarray[Any, np.dtype[np.float64]]

_Z = 1.96
_CURVES = 3
"""Curves in one plot, at most; a surface is drawn as a map."""


def draw_shape(shape: Mapping[str, Any]) -> Figure:
    """The plot of a shape, from its JSON."""
    beside = shape["beside"]
    if beside is not None and len(set(beside["x"])) > _CURVES:
        return _map(shape)
    figure, (axis,) = side_by_side(3.1, 1, width=7.2)
    x, estimate, half, mean, error = _arrays(shape)
    second = np.zeros(x.size) if beside is None else np.array(beside["x"])
    for k, value in enumerate(np.unique(second)):
        own = np.flatnonzero(second == value)
        own = own[np.argsort(x[own])]
        name = "" if beside is None else f"{beside['label']} {value:.3g} {beside['unit']}".rstrip()
        colour = f"C{k}"
        axis.errorbar(x[own], mean[own], yerr=_Z * error[own], fmt="o", ms=3, lw=0.8, color=colour, alpha=0.6)
        axis.fill_between(
            x[own], estimate[own] - half[own], estimate[own] + half[own], color=colour, alpha=0.2, linewidth=0
        )
        axis.plot(x[own], estimate[own], "-", lw=1.5, color=colour, label=name or None)
    if beside is not None:
        axis.legend(fontsize=7, frameon=False)
    dress(axis, "the shape with its 95 % band, over means of what is left", _title(shape["over"]))
    axis.set_ylabel(_title({"label": "residual", "unit": shape["unit"]}), fontsize=9)
    return figure


def _map(shape: Mapping[str, Any]) -> Figure:
    """Means of the residual and the shape, over both variables on one scale of colours."""
    x, estimate, half, mean, _ = _arrays(shape)
    y = np.array(shape["beside"]["x"])
    figure, axes = side_by_side(3.1)
    across, up = np.unique(x), np.unique(y)
    at = np.searchsorted(up, y), np.searchsorted(across, x)
    bound = float(np.max(np.abs(np.concatenate([mean, estimate]))))
    titles = "means of what is left", "the shape; dots: its 95 % band holds zero"
    for axis, values, title in zip(axes, (mean, estimate), titles, strict=True):
        grid = np.full((up.size, across.size), np.nan)
        grid[at] = values
        mesh = axis.pcolormesh(_edges(across), _edges(up), grid, cmap="RdBu_r", vmin=-bound, vmax=bound)
        dress(axis, title, _title(shape["over"]))
        axis.lines[-1].remove()
        axis.grid(visible=False)
    nothing = np.abs(estimate) <= half
    axes[1].plot(x[nothing], y[nothing], ".", ms=2, color="0.4")
    axes[0].set_ylabel(_title(shape["beside"]), fontsize=9)
    colour_scale(figure, mesh, _title({"label": "residual", "unit": shape["unit"]}))
    return figure


def _arrays(shape: Mapping[str, Any]) -> tuple[Array, Array, Array, Array, Array]:
    """(m,) variable, shape, half its 95 % band, mean residual, its standard error."""
    x, estimate, stderr, mean, error = (
        np.array(one)
        for one in (shape["over"]["x"], shape["estimate"], shape["stderr"], shape["residual"], shape["residual_stderr"])
    )
    return x, estimate, _Z * stderr, mean, error


def _title(axis: Mapping[str, Any]) -> str:
    return f"{axis['label']} / {axis['unit']}" if axis["unit"] else str(axis["label"])


def _edges(values: Array) -> Array:
    """(k + 1,) ends of cells about (k,) ascending values."""
    if values.size == 1:
        return np.array([values[0] - 0.5, values[0] + 0.5])
    middle = 0.5 * (values[1:] + values[:-1])
    return np.concatenate([[1.5 * values[0] - 0.5 * values[1]], middle, [1.5 * values[-1] - 0.5 * values[-2]]])
