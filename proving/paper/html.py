"""The document with its figures as one HTML file that needs nothing else."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import jinja2

from proving.paper.document import TITLE
from proving.paper.draw import draw
from proving.paper.study import Study
from rig.files.atomic import write_whole
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
