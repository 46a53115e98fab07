"""Columns of a table at the time at which one of its outputs was read, where the outputs have times of their own."""

from __future__ import annotations

from dataclasses import replace

from rig.procedures.column_names import read_at, since_of
from rig.procedures.tables.table import Table

TIME = "elapsed_s"


def seen_by(table: Table, output: str) -> Table:
    """The table with the time at which an output was read, and how long each setting had stood by then."""
    columns, own = table.columns, read_at(output)
    if own not in columns or TIME not in columns:
        return table
    later = columns[own] - columns[TIME]
    stood = {name for name in map(since_of, columns) if name in columns}
    return replace(table, columns={**columns, TIME: columns[own], **{name: columns[name] + later for name in stood}})
