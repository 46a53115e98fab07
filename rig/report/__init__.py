"""The report: one HTML file that needs nothing else, with the evidence a person signs on."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from rig.atomic import write_whole

if TYPE_CHECKING:
    from procedures.pressure.evaluate import WholePlotFitted
    from rig.closed_loop import Traced


def report(traced: Traced) -> str:
    """The report of a traced run as HTML; everything that came from a file is escaped."""
    from procedures.pressure.evaluate import WholePlotTraced
    from rig.report.attitude import attitude_report
    from rig.report.whole_plot import whole_plot_report

    return whole_plot_report(traced) if isinstance(traced, WholePlotTraced) else attitude_report(traced)


def write_report(path: Path, traced: Traced) -> None:
    """Write a self-contained HTML report, whole or not at all. Raises `UsageError` if the disk refuses."""
    text = report(traced)
    write_whole(path, lambda file: file.write(text))


def write_fit_report(path: Path, fitted: WholePlotFitted) -> None:
    """Write the methods side by side as HTML, whole or not at all. Raises `UsageError` if the disk refuses."""
    from rig.report.methods import fit_report

    text = fit_report(fitted)
    write_whole(path, lambda file: file.write(text))
