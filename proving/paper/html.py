"""The document with its figures as one HTML file that needs nothing else."""

from __future__ import annotations

import base64
from collections.abc import Callable
from pathlib import Path

import jinja2
import matplotlib.figure
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes

from proving.paper.document import TITLE
from proving.paper.plots import Figure, Line, Panel
from proving.paper.study import Study
from rig.files.atomic import write_whole
from rig.procedures.present.pictures import legend_below, plots, png
from rig.version import versions


def write_pages(study: Study, folder: Path, say: Callable[[str], None]) -> Path:
    """Draw every figure into `folder` and write `paper.html` beside them.

    Raises:
        UsageError: the disk refuses.

    """
    say(f"drawing {len(study.figures)} figures")
    figures = [
        {"number": f.number, "caption": f.caption, "simulated": f.simulated, "png": draw(f, folder)}
        for f in study.figures
    ]
    text = _environment().get_template("paper.html.j2").render(
        title=TITLE,
        simulated=study.simulated,
        incomplete="",
        sections=study.sections,
        figures=figures,
        provenance=[(f"software: {name}", version) for name, version in versions().items()],
        story=[],
    )  # fmt: skip
    path = folder / "paper.html"
    write_whole(path, lambda file: file.write(text))
    return path


def _environment() -> jinja2.Environment:
    """Our page within the frame of the reports."""
    loaders = [jinja2.PackageLoader("proving.paper"), jinja2.PackageLoader("rig.verbs")]
    return jinja2.Environment(loader=jinja2.ChoiceLoader(loaders), autoescape=True, undefined=jinja2.StrictUndefined)


_LINES = {"-", "--", ":", "-."}


def draw(figure: Figure, folder: Path | None) -> str:
    """Base64 PNG of a figure, also written to `folder` if there is one."""
    encoded = png(_picture(figure))
    if folder is not None:
        (folder / figure.file_name).write_bytes(base64.b64decode(encoded))
    return encoded


def _picture(figure: Figure) -> matplotlib.figure.Figure:
    count = len(figure.panels)
    columns = 1 if count == 1 else 3 if count == 3 else 2
    rows = -(-count // columns)
    picture, places = plots(rows, columns, height=3.5 * rows, width=7.0 if count == 1 else 9.6, dpi=90)
    axes = places.ravel()
    for axis, panel in zip(axes, figure.panels, strict=True):
        _panel(axis, panel)
    handles: dict[str, Artist] = {}
    for axis in axes:
        for handle, label in zip(*axis.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    if handles:
        widest = max(len(label) for label in handles)
        columns_of_legend = max(2, min(7, (100 if count == 1 else 140) // (widest + 4)))
        legend_below(picture, list(handles.values()), list(handles), columns_of_legend)
    return picture


def _panel(axis: Axes, panel: Panel) -> None:
    if panel.field is not None:
        f = panel.field
        axis.pcolormesh(f.x, f.y, np.abs(f.values), cmap="Greys_r", shading="nearest", rasterized=True, vmax=1.5)
        if f.level is not None:
            axis.contour(f.x, f.y, f.values, levels=[f.level], colors="C3", linewidths=1.2)
    for line in panel.lines:
        _line(axis, line)
    axis.set_title(panel.title, fontsize=9)
    axis.set_xlabel(panel.x_label, fontsize=9)
    axis.set_ylabel(panel.y_label, fontsize=9)
    axis.tick_params(labelsize=8)
    if panel.field is None:
        axis.grid(color="0.9", linewidth=0.6)
    if panel.y_range is not None:
        axis.set_ylim(*panel.y_range)


def _line(axis: Axes, line: Line) -> None:
    color = line.color or None
    if line.style in _LINES:
        axis.plot(line.x, line.y, line.style, color=color, label=line.label, linewidth=1.1)
    else:
        alpha = 0.55 if line.faint else 1.0
        axis.plot(line.x, line.y, line.style, color=color, label=line.label, markersize=2.6, alpha=alpha)
