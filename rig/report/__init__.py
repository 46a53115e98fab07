"""The report: one self-contained HTML file with the evidence for a signature."""

from __future__ import annotations

from pathlib import Path

from procedures.results import Page
from rig.atomic import write_whole


def write_page(path: Path, page: Page) -> None:
    """Write a self-contained HTML report, completely or not at all. Raises `UsageError` if the disk refuses."""
    from rig.report.frame import render  # noqa: PLC0415 - templates are needed for reports alone

    text = render(page)
    write_whole(path, lambda file: file.write(text))
