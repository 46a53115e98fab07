"""The frame of every report: title, SIMULATED mark, provenance, and events of the run."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import jinja2

from procedures.pictures import png
from procedures.results import Page
from procedures.words import incomplete
from rig.report.story import story

_HERE = "rig.report"


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
    provenance |= {f"not used: {each['column']}": each["why"] for each in page.unused["columns"]}
    return (
        _templates(page.package)
        .get_template(page.template)
        .render(
            title=provenance.get("procedure", Path(table.source).name),
            simulated=table.simulated,
            points=len(table),
            incomplete=incomplete(table.provenance),
            span=f"{page.span_s / 3600.0:.1f} h",
            provenance=list(provenance.items()),
            story=story(Path(table.source)) if "run_id" in provenance else [],
            **page.contents,
        )
    )
