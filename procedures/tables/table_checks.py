"""Checks of tables before conversion to arrays: units, whole numbers, duplicate positions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from rig.procedures.column_names import split_unit
from rig.procedures.errors import DataError
from rig.procedures.tables.order_through import counts_through, through
from rig.procedures.tables.table import UNITS, Table

_LARGEST = 2.0**53


def order_of(
    table: Table, order: np.ndarray[Any, np.dtype[np.int64]], blocks: Sequence[str]
) -> np.ndarray[Any, np.dtype[np.int64]]:
    """(n,) executed positions through the run, each once; they may begin anew in each of the named blocks.

    Raises:
        DataError: a position occurs twice.
    """
    if not counts_through(order):
        named = [integers(table, name) for name in blocks if name in table.columns]
        pairs = [
            *named,
            *([np.unique(np.column_stack(named), axis=0, return_inverse=True)[1].reshape(-1)] if named else []),
        ]
        found = through(order, pairs, table.columns.get("elapsed_s"))
        if found is not None:
            return found
    check_order(table, order)
    return order


def check_order(table: Table, order: np.ndarray[Any, np.dtype[np.int64]]) -> None:
    """Refuse a duplicate position in the order. Raises `DataError`."""
    seen, counts = np.unique(order, return_counts=True)
    if (counts > 1).any():
        twice = int(seen[counts > 1][0])
        rows = [table.row(int(r)) for r in np.flatnonzero(order == twice)[:2]]
        raise DataError(
            f"{table.source}, rows {rows[0]} and {rows[1]}: order {twice} is there twice; is a point copied?"
        )


def integers(table: Table, name: str) -> np.ndarray[Any, np.dtype[np.int64]]:
    """(n,) whole numbers of a column. Raises `DataError` with the first invalid row."""
    values = table.columns[name]
    if (np.abs(values) > _LARGEST).any():
        row = int(np.flatnonzero(np.abs(values) > _LARGEST)[0])
        raise DataError(
            f"{table.source}, row {table.row(row)}, column {name}: {values[row]:g} is too large for such a number"
        )
    whole = values.astype(np.int64)
    if (whole != values).any():
        row = int(np.flatnonzero(whole != values)[0])
        raise DataError(f"{table.source}, row {table.row(row)}, column {name}: {values[row]:g} is not a whole number")
    return whole


def check_units(table: Table) -> None:
    """Refuse a known quantity with another unit. Raises `DataError`."""
    for name in table.columns:
        stem, unit = split_unit(name)
        wanted = UNITS.get(stem)
        if stem in ("x", "y", "z"):
            wanted = "V"
        if wanted is not None and unit != wanted and not name.endswith("_side"):
            raise DataError(f"{table.source}: column {name} is in {unit!r}; convert it and name it {stem}_{wanted}")
