"""From a table to what it says: fit, trace, error before and after."""

from __future__ import annotations

from typing import Any

from fitter import fit_all
from rig.errors import UsageError
from rig.tables import Table, attitude_data


def fit_table(table: Table) -> dict[str, Any]:
    """Fit the declared model to every sensor of a pitch-roll table; JSON-ready. Raises `UsageError`."""
    data = attitude_data(table)
    try:
        fits = fit_all(data)
    except ValueError as error:
        raise UsageError(f"{table.source}: {error}") from error
    return {
        "data": {"points": len(table), "kind": "pitch-roll", "simulated": table.simulated, **table.provenance},
        "sensors": {name: fit.to_dict() for name, fit in fits.items()},
    }
