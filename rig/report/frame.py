"""What every report has around its contents: title, SIMULATED, provenance, and the run hour by hour."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import jinja2

from procedures.table import Table
from procedures.unused import unused_in_fit
from procedures.words import incomplete
from rig.report.story import story


@cache
def _templates() -> jinja2.Environment:
    return jinja2.Environment(
        loader=jinja2.PackageLoader("rig.report"), autoescape=True, undefined=jinja2.StrictUndefined
    )


def render(
    template: str, table: Table, *, span_s: float, unused: Mapping[str, Any] | None = None, **contents: object
) -> str:
    """Fill a template; everything that came from a file is escaped.

    Args:
        template: its name.
        table: where the data come from.
        span_s: from the first observation to the last.
        unused: columns and rows that play no part; None for those that no fit of the table's kind looks at.
        contents: what the template itself wants.

    """
    provenance = dict(table.provenance)
    software = provenance.pop("software", {})
    instruments = provenance.pop("instruments", {})
    provenance |= {f"instrument: {name}": words for name, words in instruments.items()}
    provenance |= {f"software: {name}": version for name, version in software.items()}
    spare = unused_in_fit(table).to_json() if unused is None else unused
    provenance |= {f"not used: {each['column']}": each["why"] for each in spare["columns"]}
    return (
        _templates()
        .get_template(template)
        .render(
            title=provenance.get("procedure", Path(table.source).name),
            simulated=table.simulated,
            points=len(table),
            incomplete=incomplete(table.provenance),
            span=f"{span_s / 3600.0:.1f} h",
            provenance=list(provenance.items()),
            story=story(Path(table.source)) if "run_id" in provenance else [],
            **contents,
        )
    )
