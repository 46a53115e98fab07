"""The report: one HTML file that needs nothing else, with the evidence a person signs on."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from rig.atomic import write_whole

if TYPE_CHECKING:
    from rig.closed_loop import Traced, WholePlotFitted


def report(traced: Traced) -> str:
    """The report of a traced run as HTML; everything that came from a file is escaped."""
    from rig.closed_loop import WholePlotTraced  # noqa: PLC0415 - plots take a second to import
    from rig.report.attitude import attitude_report  # noqa: PLC0415
    from rig.report.whole_plot import whole_plot_report  # noqa: PLC0415

    return whole_plot_report(traced) if isinstance(traced, WholePlotTraced) else attitude_report(traced)


def write_report(path: Path, traced: Traced) -> None:
    """Write a self-contained HTML report, whole or not at all. Raises `UsageError` if the disk refuses."""
    text = report(traced)
    write_whole(path, lambda file: file.write(text))


def write_fit_report(path: Path, fitted: WholePlotFitted) -> None:
    """Write the methods side by side as HTML, whole or not at all. Raises `UsageError` if the disk refuses."""
    from rig.report.methods import fit_report  # noqa: PLC0415

    text = fit_report(fitted)
    write_whole(path, lambda file: file.write(text))
