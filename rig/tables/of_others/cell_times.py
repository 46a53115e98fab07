"""Times of day and year in the cells of a table of others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from rig.procedures.tables.dates import Stamp, form_of, stamp_of
from rig.tables.of_others.numbers import is_missing

_FIRST = 50
"""Cells of a column by which its dates are recognised."""


def times_of(columns: Mapping[str, Sequence[str]]) -> dict[str, str]:
    """How the dates of columns are read, in words, by column; "" where they leave no doubt."""
    found = {}
    for name, cells in columns.items():
        stamps = _stamps(cells)
        if stamps:
            found[name] = form_of(stamps)
    return found


def dates_with_dots(cells: Sequence[str]) -> bool:
    """Whether a column has dates with dots between their numbers, as 24.11.2020."""
    return any(stamp.numbers and stamp.sign == "." for stamp in _stamps(cells[:_FIRST]))


def _stamps(cells: Sequence[str]) -> list[Stamp]:
    """The times of a column; [] if it has anything else."""
    found = []
    for cell in cells:
        if is_missing(cell):
            continue
        if (stamp := stamp_of(cell)) is None:
            return []
        found.append(stamp)
    return found
