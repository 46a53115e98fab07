"""Numbers that are too large or too small to compute with: a statement about one cell, before statistics overflow."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from rig.errors import UsageError
from rig.procedures.tables.table import Table

LARGEST, SMALLEST = 1e60, 1e-60
"""Sums of fourth powers, as statistics need them, are still doubles, and not zero."""


def usable(table: Table, needed: Collection[str] | None = None) -> Table:
    """The table, without columns that are not needed and hold such a number (they count as columns with a gap).

    Args:
        table: as it was read.
        needed: columns that are used for certain; None for all.

    Raises:
        UsageError: a needed column holds such a number. It says the row and what to do.
    """
    needed = list(table.columns) if needed is None else needed
    gaps = dict(table.gaps)
    for name, values in table.columns.items():
        large = np.flatnonzero(np.abs(values) > LARGEST)
        if large.size and name in needed:
            raise UsageError(
                f"{table.source}, row {table.row(int(large[0]))}, column {name}: {values[large[0]]:g} is too large to "
                f"compute with (more than {LARGEST:g}); correct the cell, leave it empty if there was no reading, or "
                f"give the column in a larger unit"
            )
        if large.size:
            gaps[name] = table.row(int(large[0]))
        elif name in needed and 0.0 < np.max(np.abs(values), initial=0.0, where=np.isfinite(values)) < SMALLEST:
            raise UsageError(
                f"{table.source}, column {name}: its values are too small to compute with (less than {SMALLEST:g}); "
                f"give the column in a smaller unit"
            )
    if len(gaps) == len(table.gaps):
        return table
    kept = {name: values for name, values in table.columns.items() if name not in gaps}
    return replace(table, columns=kept, gaps=gaps)
