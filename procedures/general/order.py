"""Order of measurement of the rows of a table."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.errors import FitError
from rig.procedures.general.clock_texts import seconds_of
from rig.procedures.general.effects.scene import Timeline, seconds_per_unit
from rig.procedures.tables.order_through import through
from rig.procedures.tables.table import Table

_CLOCKS = re.compile(
    r"time|elapsed|date|^years?$|^t$|^t_?(s|sec|min|h|hours|days)$|^t_start|^hours?$|^days?$", re.IGNORECASE
)
_COUNTERS = re.compile(
    r"^(seq|sequence|order|block|index|row|reading|n|no|nr|number|run_order|run_index)$", re.IGNORECASE
)
"""Names of columns used as time by default."""
_ROW_NAMES = re.compile(r"^(row_?(names?|id|no|nr|number)|unnamed: ?0)$", re.IGNORECASE)
"""Of rows that another program numbered as it wrote the file, which says nothing of the order of measurement."""
_MORE = "steps, oscillations, carry-over and drifting sensitivity are looked for then too"
_MAYBE = ", and effects had to stand out from errors that are alike along the rows, as they are if taken in this order"
_SAME = 0.9999


@dataclass(frozen=True)
class Parts:
    """Columns by which rows may be sorted, and declarations about their order.

    Attributes:
        settings: of the declared model, and the reference of a difference.
        groups: groupings, whole plots and categories of the declared model.
        free: unused columns of numbers.
        time: the declared column; None if none was.
        direction: the same.
        date: column of the dates of a time of day; None if there is none.
        date_order: of day and month in dates; None if dates must show it.
        blocks: columns in whose levels an order may begin anew.
        response: its columns.
    """

    settings: tuple[str, ...]
    groups: tuple[str, ...]
    free: tuple[str, ...]
    time: str | None
    direction: str | None
    date: str | None = None
    date_order: str | None = None
    blocks: tuple[str, ...] = ()
    response: tuple[str, ...] = ()


def time_of(table: Table, parts: Parts, notes: list[str]) -> tuple[Timeline | None, bool]:
    """The column of time, and whether sorted rows may be in the order of measurement, although it is unknown.

    The column is the declared one, or found by its name if its values increase, or the order of rows if possible.
    """
    if parts.time is not None:
        return _declared(table, parts, notes), False
    for pattern in (_CLOCKS, _COUNTERS):
        for name in parts.free:
            v = table.columns[name]
            if pattern.search(name) and len(np.unique(v)) > 0.5 * len(v) and np.mean(np.diff(v) >= 0) > 0.95:
                counts = pattern is _COUNTERS
                more = f"; --time {name} declares it: {_MORE}" if counts else ""
                what = "the order of measurement" if counts else "the time"
                notes.append(f"{name} is used as {what}; --ignore {name} leaves it out{more}")
                return Timeline(name, v, seconds_per_unit(name), presumed=pattern is _COUNTERS), False
    for name in parts.free:
        anew = _anew(table, parts, name) if _COUNTERS.search(name) else None
        if anew is not None:
            notes.append(
                f"{name} begins anew in each {' and '.join(parts.blocks)} and is used as the order through the run"
            )
            return Timeline(name, anew, presumed=True), False
    by = _sorted_by(table, parts)
    if by is not None and parts.direction not in parts.settings:
        along = by in table.columns and by in {*parts.settings, *parts.free} and _rises(table.columns[by])
        notes.append(
            f"rows are sorted by {by} and no column of time was given, so their order in time is not known: "
            f"drift, steps, carry-over and lags were not looked for{_MAYBE if along else ''}; --time names the column"
        )
        return None, along
    notes.append(f"rows are assumed to be in the order of measurement; with --time COLUMN, {_MORE}")
    return Timeline("row", np.arange(1.0, len(table) + 1.0), presumed=True), False


def _declared(table: Table, parts: Parts, notes: list[str]) -> Timeline:
    """The declared column of time: numbers, or dates and times."""
    name = parts.time or ""
    dates = None
    if parts.date is not None:
        if parts.date not in table.text:
            raise FitError(f"--date: {parts.date} holds numbers; give a column of dates, such as 2026-01-15")
        dates = table.text[parts.date].tolist()
    if name in table.text:
        values = seconds_of(name, table.text[name].tolist(), dates, parts.date_order)
        return Timeline(name, values, 1.0)
    if dates is not None:
        raise FitError(f"--time: {name} holds numbers, and --date goes with times of day, such as 09:30:00")
    anew = _anew(table, parts, name)
    if anew is not None:
        notes.append(f"{name} begins anew in each {' and '.join(parts.blocks)} and is counted through the run")
        return Timeline(name, anew, None)
    unit = table.units.get(name)
    return Timeline(
        name, table.columns[name], seconds_per_unit(f"t_{unit}" if unit else name) or seconds_per_unit(name)
    )


def _anew(table: Table, parts: Parts, name: str) -> FloatArray | None:
    """(n,) positions counted through the run, if they begin anew in each block; None otherwise."""
    v = table.columns[name]
    if not parts.blocks or np.unique(v).size == v.size or (v != np.round(v)).any():
        return None
    every = {**table.columns, **table.text}
    found = through(v, [identities(every, parts.blocks), *(codes(every[one]) for one in parts.blocks)])
    return None if found is None else found.astype(np.float64)


def _sorted_by(table: Table, parts: Parts) -> str | None:
    """The column by which rows are sorted, if it is not time."""
    for name in parts.settings:
        if name in table.columns and name not in parts.groups and _rises(table.columns[name]):
            return name
    for name in parts.free:
        if _rises(table.columns[name]) and len(np.unique(np.sign(np.diff(table.columns[name])))) == 1:
            return name
    every = {**table.columns, **table.text}
    for name in parts.groups:
        index = codes(every[name])
        if np.count_nonzero(np.diff(index)) == index.max():
            return name
    for name in parts.free:
        v = table.columns[name]
        if np.all(v == np.round(v)) and 1 < len(np.unique(v)) <= len(v) // 3 and np.all(np.diff(v) >= 0):
            return name
    for name in parts.response:  # a list of readings by size; a drift without any scatter would look like this, too
        step = np.diff(table.columns.get(name, np.empty(0)))
        if step.size and (np.all(step >= 0) or np.all(step <= 0)):
            return name
    return None


def _rises(v: FloatArray) -> bool:
    """Whether values increase or decrease throughout, except for a few that scatter."""
    rank = np.argsort(np.argsort(v, kind="stable"), kind="stable").astype(np.float64)
    if np.ptp(v) == 0:
        return False
    return bool(abs(np.corrcoef(rank, np.arange(len(v)))[0, 1]) > 0.99)


def alike(v: FloatArray, time: Timeline, notes: list[str], name: str) -> bool:
    """Whether a column is equivalent to time, or counts the rows in its order."""
    if _COUNTERS.search(name) and len(v) > 1 and bool((np.diff(v) > 0).all()):
        notes.append(f"{name} counts the rows and was not looked at by itself")
        return True
    if np.ptp(v) == 0 or np.ptp(time.values) == 0 or abs(np.corrcoef(v, time.values)[0, 1]) < _SAME:
        return False
    notes.append(f"{name} runs with {time.name} and was not looked at by itself")
    return True


def numbers_rows(name: str, v: FloatArray) -> bool:
    """Whether a column has the numbers that another program gave to the rows of its file."""
    return bool(_ROW_NAMES.search(name)) and np.unique(v).size == v.size and bool((v == np.round(v)).all())


def codes(values: Any) -> IntArray:
    """(n,) rank of each value among the distinct ones, ascending."""
    return np.asarray(np.unique(values, return_inverse=True)[1], np.int64)


def identities(columns: Mapping[str, Any], names: Sequence[str]) -> IntArray:
    """(n,) one whole number for each combination of values of these columns."""
    keys = np.column_stack([codes(columns[name]) for name in names])
    return np.asarray(np.unique(keys, axis=0, return_inverse=True)[1], np.int64).reshape(-1)
