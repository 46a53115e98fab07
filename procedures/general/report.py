"""The report of a trace in a table of any kind: what was found, error before and after, residuals.

The residual's running mean shows what a cloud of points hides.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from rig.procedures.evaluate.results import Page
from rig.procedures.evaluate.trace_page import trace_page
from rig.procedures.present.pictures import BEFORE_AFTER, dress, side_by_side

if TYPE_CHECKING:
    from rig.procedures.evaluate.results import Traced
    from rig.procedures.general.trace import TableTrace

Array = np.ndarray[Any, np.dtype[np.float64]]

_PARTS = 12
_APART = 3
"""Maximum number of values of a numeric variable drawn like levels: a mean at each and no line."""
_TICKS, _WIDE = 24, 50
"""Maximum number of displayed level names, and length from which they are rotated."""


def residuals_over(
    name: str, values: Array, left: tuple[Array, Array], response: str, levels: Sequence[str] | None = None
) -> Figure:
    """Residuals (n,) before and after over a variable (n,), on one scale.

    Args:
        name: of the variable.
        values: of the variable; for a group the index of each row's level.
        left: residuals before and after.
        response: its name.
        levels: names of the levels, if the variable is a group.
    """
    figure, axes = side_by_side(3.2)
    apart = levels is not None or len(np.unique(values)) <= _APART
    for axis, residual, title in zip(axes, left, BEFORE_AFTER, strict=True):
        axis.plot(values, residual, "o", ms=3, alpha=0.5)
        if apart:
            axis.plot(*_means(values, residual, each=True), "_", color="C1", ms=18, mew=2.5, label="mean")
        else:
            axis.plot(*_means(values, residual), "-", color="C1", lw=1.5, label="running mean")
        dress(axis, title, name)
        if apart:
            axis.margins(x=0.25)
            _name_ticks(axis, values, levels)
    axes[0].set_ylabel(f"residual of {response}", fontsize=9)
    axes[0].legend(fontsize=7, frameon=False)
    return figure


def _name_ticks(axis: Any, values: Array, levels: Sequence[str] | None) -> None:
    """A tick at each level, or at some of many."""
    places = np.unique(values) if levels is None else np.arange(len(levels), dtype=np.float64)
    places = places[:: -(-len(places) // _TICKS)]
    names = [f"{place:g}" if levels is None else levels[int(place)] for place in places]
    long = sum(map(len, names)) > _WIDE
    axis.set_xticks(places, names, rotation=45 if long else 0, ha="right" if long else "center")


def _means(values: Array, residual: Array, *, each: bool = False) -> tuple[Array, Array]:
    """Mean residual in parts of the range with equal numbers of rows, or at each of few values."""
    distinct, index = np.unique(values, return_inverse=True)
    if len(distinct) > _PARTS and not each:
        order = np.argsort(values, kind="stable")
        index = np.empty(len(values), np.int64)
        index[order] = np.arange(len(values)) * _PARTS // len(values)
    count = np.maximum(np.bincount(index), 1)
    return np.bincount(index, values) / count, np.bincount(index, residual) / count


_PLOTS = 6


def page_of(traced: Traced, each: Mapping[str, TableTrace], **more: Any) -> Page:
    """The report of traces of one table: of one response, or of every sensor of a run.

    Args:
        traced: all of them.
        each: trace of every response, by its name.
        more: of a run: "not_traced", outputs whose declared model no trace can use, and "common", sentences about
            effects that all sensors share.
    """
    return trace_page(
        traced, "rig.procedures.general", lambda name: _plots(each[name]), **{"not_traced": (), "common": ()} | more
    )


def _plots(trace: TableTrace) -> list[dict[str, Any]]:
    """Residuals before and after, over each effect's own variable; over all variables without findings."""
    wanted = dict.fromkeys(effect.against for effect in trace.added if effect.against in trace.variables)
    shown = list(wanted or trace.variables)[:_PLOTS]
    left = trace.before.fit.left, trace.after.fit.left
    return [
        {
            "alt": f"residuals of {trace.response} over {name}, before and after",
            "figure": residuals_over(name, trace.variables[name], left, trace.response, trace.levels.get(name)),
        }
        for name in shown
    ]
