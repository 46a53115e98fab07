"""Figures as embedded PNG."""

from __future__ import annotations

import base64
import io
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure


def side_by_side(height: float, count: int = 2, *, width: float = 9.6, share_y: bool = True) -> tuple[Figure, Any]:
    """A figure with `count` plots in a row on one scale; height and width in inches."""
    figure = Figure(figsize=(width, height), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    return figure, figure.subplots(1, count, sharex=True, sharey=share_y, squeeze=False)[0]


def three_panels(height: float, *, width: float = 9.6, share_y: bool = True) -> tuple[Figure, Any]:
    """A figure with three plots in a row, each with its own x; height and width in inches."""
    figure = Figure(figsize=(width, height), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    return figure, figure.subplots(1, 3, sharey=share_y, squeeze=False)[0]


def grid(count: int, *, columns: int, height: float, width: float = 9.6) -> tuple[Figure, Any]:
    """A figure with `count` plots in rows of `columns`, each on its own scale; inches, height of one row."""
    rows = -(-count // columns)
    figure = Figure(figsize=(width, height * rows), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(rows, columns, sharex=True, squeeze=False).ravel()
    for axis in axes[count:]:
        axis.set_visible(False)
    return figure, axes


def png(figure: Figure) -> str:
    """Base64 of a figure."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", metadata={"Software": None})
    return base64.b64encode(buffer.getvalue()).decode("ascii")
