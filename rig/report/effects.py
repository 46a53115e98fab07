"""An effect as the reports' templates take it."""

from __future__ import annotations

from typing import Any

from rig.report.words import capitalised, chance, share, units


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
            {"term": term, "value": f"{value:.4g}", "stderr": f"{error:.2g}", "unit": unit}
            for term, value, error, unit in rows
        ],
    }
