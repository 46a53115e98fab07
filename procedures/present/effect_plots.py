"""One effect before and after, over its own variable and over its contribution: a figure per effect and sensor."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rig.fitter.trace.outcome import Figure as View
from rig.procedures.present.pictures import dress, three_panels

Array = np.ndarray[Any, np.dtype[np.float64]]
Groups = np.ndarray[Any, np.dtype[np.int64]]

_DISTINCT = 40
"""Maximum number of values of a variable with a separate mean for each."""
_PARTS = 20
_OWN = 0.5
"""Minimum share of an effect in means over its own variable; below it, positive and negative parts are shown
separately.
"""


def drawn(views: Mapping[str, View]) -> dict[str, Figure]:
    """Plots of every effect and finding about noise, by its name."""
    return {name: draw(view) for name, view in views.items()}


def draw(view: View) -> Figure:
    """The plot of an effect or of a finding about the noise."""
    return _noise_plot(view) if view.adds is None else _effect_plot(view, view.adds)


def _effect_plot(view: View, adds: Array) -> Figure:
    """Residual without and with an effect over its own variable, and over its contribution.

    Dots are observations, marks their means with 95 % intervals, lines the fit. An effect that cancels in the means
    over its own variable (its sign depends on direction or on a second angle) is shown separately for positive and
    negative contributions.
    """
    figure, (without, having, added) = three_panels(3.1)
    bins = _bins(view.x)
    series = _series(adds, bins)
    left = view.left + adds
    for axis, residual, title in (
        (without, left, "without this effect"),
        (having, view.left, "with it"),
    ):
        axis.plot(view.x, residual, ".", ms=2, alpha=0.25, color="0.6", zorder=1)
        for rows, colour, name in series:
            _means(axis, view.x[rows], residual[rows], bins[rows], colour, name)
            if axis is without:
                axis.plot(*_averaged(view.x[rows], adds[rows], bins[rows])[:2], "-", lw=1.2, color=colour)
        dress(axis, title, view.label)
    if len(series) > 1:
        without.legend(fontsize=7, frameon=False)
    added.plot(adds, left, ".", ms=2, alpha=0.25, color="0.6", zorder=1)
    _means(added, adds, left, _bins(adds), "C0", "")
    ends = np.array([adds.min(), adds.max()])
    added.plot(ends, ends, "-", color="C0", lw=1.2)
    dress(added, "without it, over its contribution", f"contribution of the effect / {view.unit}")
    added.locator_params(axis="x", nbins=5)
    without.set_ylabel(f"residual / {view.unit}", fontsize=9)
    bound = 1.1 * float(np.percentile(np.abs(left), 99.5))
    without.set_ylim(-bound, bound)
    return figure


def _noise_plot(view: View) -> Figure:
    """Residual over the variable of a finding about noise: readings, means and scatter."""
    x, residual = view.x, view.left
    figure, (readings, means, scatter) = three_panels(2.9, share_y=False)
    bins = _bins(x)
    readings.plot(x, residual, ".", ms=2.5, alpha=0.5, color="C0")
    _means(means, x, residual, bins, "C0", "")
    at, mean, count = _averaged(x, residual, bins)
    variance = (_averaged(x, residual**2, bins)[1] - mean**2) * count / np.maximum(count - 1, 1)
    sd, several = np.sqrt(np.maximum(variance, 0.0)), count > 2
    half = 1.96 * sd / np.sqrt(2.0 * np.maximum(count - 1, 1))
    scatter.errorbar(at[several], sd[several], yerr=half[several], fmt="o", ms=3, lw=0.9, color="C0")
    scatter.set_ylim(bottom=0)
    for axis, title in ((readings, "readings"), (means, "their means"), (scatter, "their standard deviation")):
        dress(axis, title, view.label)
    readings.set_ylabel(f"residual / {view.unit}", fontsize=9)
    return figure


def _bins(x: Array) -> Groups:
    """(n,) index of the value of x, or of the part of its range with about the same number of rows as the others."""
    distinct, index = np.unique(np.round(x, 9), return_inverse=True)
    if len(distinct) > _DISTINCT:
        edges = np.unique(np.quantile(x, np.linspace(0, 1, _PARTS + 1)))
        index = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, max(len(edges) - 2, 0))
    return np.asarray(np.unique(index, return_inverse=True)[1], np.int64)


def _series(adds: Array, bins: Groups) -> list[tuple[np.ndarray[Any, np.dtype[np.bool_]], str, str]]:
    """(rows, colour, name): all rows, or those with positive and with negative contribution."""
    mean = (np.bincount(bins, adds) / np.bincount(bins))[bins]
    everything = np.ones(len(bins), np.bool_)
    if np.sum(mean**2) >= _OWN * np.sum(adds**2):
        return [(everything, "C0", "")]
    less = adds < 0
    return [(~less, "C0", "where it adds"), (less, "C1", "where it takes away")]


def _means(axis: Axes, x: Array, y: Array, bins: Groups, colour: str, name: str) -> None:
    at, mean, count = _averaged(x, y, bins)
    left = y - (np.bincount(bins, y) / np.maximum(np.bincount(bins), 1))[bins]
    sd = np.sqrt(np.sum(left**2) / max(len(y) - len(count), 1))
    axis.errorbar(at, mean, yerr=1.96 * sd / np.sqrt(count), fmt="o", ms=3, lw=0.9, color=colour, label=name or None)


def _averaged(x: Array, y: Array, bins: Groups) -> tuple[Array, Array, Array]:
    """Means of x and of y in each bin with observations, and their number."""
    count = np.bincount(bins).astype(np.float64)
    kept = count > 0
    return np.bincount(bins, x)[kept] / count[kept], np.bincount(bins, y)[kept] / count[kept], count[kept]
