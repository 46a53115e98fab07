"""The report: one self-contained HTML file with the evidence for a signature."""

from __future__ import annotations

from pathlib import Path

from rig.files.atomic import write_whole
from rig.procedures.evaluate.results import Page


def write_page(path: Path, page: Page) -> None:
    """Write a self-contained HTML report, completely or not at all. Raises `UsageError` if the disk refuses."""
    from rig.verbs.page import render  # noqa: PLC0415 - templates are needed for reports alone

    text = render(page)
    write_whole(path, lambda file: file.write(text))
