"""Figures of reports.

Margins are fixed, in inches: fitting them to labels would take twice the time of drawing.
"""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from typing import Any

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.figure import Figure

_LEFT, _RIGHT, _TOP, _BOTTOM = 0.8, 0.32, 0.3, 0.48
_NUMBERS, _CLOSE, _TITLES = 0.72, 0.16, 0.38
"""Space between plots: side by side with numbers between them, or without; below each other, with room for a title."""
_SCALE, _SCALE_WIDTH = 1.1, 0.14
_LEGEND_LINE = 0.17

BEFORE_AFTER = ("before: declared model", "after: with the effects found")
"""Titles of two plots of residuals on one scale."""


def side_by_side(height: float, count: int = 2, *, width: float = 9.6) -> tuple[Figure, Any]:
    """A figure with `count` plots in a row on one scale; height and width in inches."""
    figure, axes = plots(1, count, height=height, width=width, share_x=True, share_y=True)
    return figure, axes[0]


def three_panels(height: float, *, share_y: bool = True) -> tuple[Figure, Any]:
    """A figure with three plots in a row, each with its own x; height in inches."""
    figure, axes = plots(1, 3, height=height, share_y=share_y)
    return figure, axes[0]


def grid(count: int, *, columns: int, height: float, width: float = 9.6) -> tuple[Figure, Any]:
    """A figure with `count` plots in rows of `columns`, each on its own scale; inches, height of one row."""
    rows = -(-count // columns)
    figure, axes = plots(rows, columns, height=height * rows, width=width, share_x=True)
    for axis in axes.ravel()[count:]:
        axis.set_visible(False)
    return figure, axes.ravel()


def plots(
    rows: int,
    columns: int,
    *,
    height: float,
    width: float = 9.6,
    share_x: bool = False,
    share_y: bool = False,
    dpi: float = 110,
) -> tuple[Figure, Any]:
    """A figure and its (rows, columns) plots; height and width of all in inches."""
    figure = Figure(figsize=(width, height), dpi=dpi)
    FigureCanvasAgg(figure)
    gap = _CLOSE if share_y else _NUMBERS
    down = _TITLES if share_x else _TITLES + _BOTTOM
    wide = (width - _LEFT - _RIGHT - (columns - 1) * gap) / columns
    high = (height - _TOP - _BOTTOM - (rows - 1) * down) / rows
    figure.subplots_adjust(
        left=_LEFT / width,
        right=1.0 - _RIGHT / width,
        bottom=_BOTTOM / height,
        top=1.0 - _TOP / height,
        wspace=gap / wide,
        hspace=down / high,
    )
    return figure, figure.subplots(rows, columns, sharex=share_x, sharey=share_y, squeeze=False)


def legend_below(
    figure: Figure, handles: Sequence[Artist], labels: Sequence[str], columns: int, **options: Any
) -> None:
    """One legend for all plots, below them, with additional space."""
    lines = -(-len(labels) // columns)
    height = figure.get_figheight() + lines * _LEGEND_LINE
    taller = height / figure.get_figheight()
    margins = figure.subplotpars
    figure.set_figheight(height)
    figure.subplots_adjust(bottom=1.0 - (1.0 - margins.bottom) / taller, top=1.0 - (1.0 - margins.top) / taller)
    figure.legend(
        handles, labels, loc="lower center", ncols=columns, fontsize=7, frameon=False, borderaxespad=0.1, **options
    )


def colour_scale(figure: Figure, mappable: ScalarMappable, label: str) -> None:
    """The scale of a figure's colours, right of its plots."""
    width, margins = figure.get_figwidth(), figure.subplotpars
    figure.subplots_adjust(right=1.0 - _SCALE / width)
    left = 1.0 - (_SCALE - _CLOSE) / width
    beside = figure.add_axes((left, margins.bottom, _SCALE_WIDTH / width, margins.top - margins.bottom))
    figure.colorbar(mappable, cax=beside, label=label)


def dress(axis: Axes, title: str, label: str) -> None:
    """Titles, a grid and a line at zero for residuals over a variable."""
    axis.set_title(title, fontsize=9)
    axis.set_xlabel(label, fontsize=9)
    axis.grid(color="0.9", linewidth=0.6)
    axis.tick_params(labelsize=8)
    axis.axhline(0, color="0.5", linewidth=0.7)


def png(figure: Figure) -> str:
    """Base64 of a figure as PNG."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", metadata={"Software": None})
    return base64.b64encode(buffer.getvalue()).decode("ascii")
