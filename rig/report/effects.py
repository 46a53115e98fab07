"""An effect as the reports' templates take it."""

from __future__ import annotations

from typing import Any

from rig.report.words import capitalised, chance, share, units, with_error


def effect_rows(effect: dict[str, Any]) -> dict[str, Any]:
    """An effect's JSON with numbers as text and a row a term."""
    rows = zip(effect["terms"], effect["coefficients"], effect["stderr"], units(effect), strict=True)
    return {
        **effect,
        "share": share(effect),
        "p": chance(effect),
        "cause": capitalised(effect["cause"]),
        "aliases": ", ".join(effect["aliases"]),
        "terms": [
            dict(zip(("term", "value", "stderr", "unit"), (term, *with_error(value, error), unit), strict=True))
            for term, value, error, unit in rows
        ],
    }
