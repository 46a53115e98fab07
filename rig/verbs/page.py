"""The frame of every report: title, SIMULATED mark, provenance, and events of the run.

The contents are those of each kind: `procedures/KIND/report.py` and `procedures/KIND/templates/report.html.j2`.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import NamedTuple

import jinja2

from rig.procedures.evaluate.results import Page
from rig.procedures.present.durations import duration
from rig.procedures.present.pictures import png
from rig.procedures.present.words import incomplete
from rig.procedures.tables.table import CORRECTED
from rig.run_file.read.reader import RunReader

_HERE = "rig.verbs"


@cache
def _templates(package: str) -> jinja2.Environment:
    """Templates of a package; they may extend and include ours."""
    loaders = [jinja2.PackageLoader(name) for name in dict.fromkeys((package, _HERE))]
    found = jinja2.Environment(loader=jinja2.ChoiceLoader(loaders), autoescape=True, undefined=jinja2.StrictUndefined)
    found.filters["png"] = png
    return found


def render(page: Page) -> str:
    """A report as HTML; text from files is escaped."""
    table, provenance = page.table, dict(page.table.provenance)
    software = provenance.pop("software", {})
    instruments = provenance.pop("instruments", {})
    provenance |= {f"instrument: {name}": words for name, words in instruments.items()}
    provenance |= {f"software: {name}": version for name, version in software.items()}
    if told := provenance.get(CORRECTED):
        provenance[CORRECTED] = "; ".join(told)
    provenance |= {f"not used: {each['column']}": each["why"] for each in page.unused["columns"]}
    return (
        _templates(page.package)
        .get_template(page.template)
        .render(
            title=provenance.get("procedure", Path(table.source).name),
            simulated=table.simulated,
            points=len(table),
            incomplete=incomplete(table.provenance),
            span=duration(page.span_s),
            provenance=list(provenance.items()),
            story=story(Path(table.source)) if "run_id" in provenance else [],
            **page.contents,
        )
    )


class Line(NamedTuple):
    """One event: its time, in hours and minutes of bench time, and a sentence."""

    when: str
    what: str


def story(path: Path) -> list[Line]:
    """The events of a run file, in order, without the ordinary steps of points."""
    with RunReader.open(path) as reader:
        reader.about()  # a file that does not begin with the record of its run
        told = (r for r in reader.records() if not r.accepted and r.event.importance.page)
        return [Line(_clock(record.elapsed_s), record.sentence()) for record in told]


def _clock(seconds: float) -> str:
    minutes = int(seconds // 60)
    return f"{minutes // 60}:{minutes % 60:02d}"
