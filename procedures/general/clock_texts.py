"""Dates and times of day written as text, as seconds."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.errors import FitError
from rig.procedures.tables.dates import Stamp, of_one_day, orders_of, stamp_of


def is_clock(cells: Sequence[str]) -> bool:
    """Whether all texts are dates or times of day, in some order."""
    return bool(len(cells)) and all(stamp_of(cell) is not None for cell in cells)


def seconds_of(
    name: str, cells: Sequence[str], dates: Sequence[str] | None = None, order: str | None = None
) -> FloatArray:
    """Seconds since the first row.

    Args:
        name: of the column, for messages.
        cells: (n,) dates with times, dates, or times of day.
        dates: (n,) dates of the times of day, if they have a column of their own.
        order: "dmy", "mdy" or "ymd" for dates such as 03/04/2026 or 20-02-21; None if they must show it: by a number
            above 12, by dots between them (dmy), or since all are of one day.

    Raises:
        FitError: a text is not a date or a time, or a date can be read in two ways.
    """
    if dates is not None:
        days = _days(name, dates, order)
        seconds = np.array([_of_day(name, cell) for cell in cells]) + days
        return np.asarray(seconds - seconds[0])
    if all((stamp := stamp_of(cell)) is not None and not stamp.numbers for cell in cells):
        found = np.array([_of_day(name, cell) for cell in cells])
        if (np.diff(found) < 0).any():
            raise FitError(f"--time: {name} has times of day that go back, as over midnight; name the date with --date")
        return np.asarray(found - found[0])
    found = _days(name, cells, order)
    return np.asarray(found - found[0])


def _days(name: str, cells: Sequence[str], order: str | None) -> FloatArray:
    """Seconds of dates, with or without a time of day."""
    stamps = [_dated(name, cell) for cell in cells]
    if len({stamp.zone is not None for stamp in stamps}) > 1:
        raise FitError(f"{name}: some times have a zone and others have none; write all of them alike")
    order = order or _order(name, cells, stamps)
    found = []
    for cell, stamp in zip(cells, stamps, strict=True):
        if not stamp.fits(order) and not stamp.ordered:
            raise FitError(f"--time: {name} has {cell[:40]!r}, which is no date in the order {order}")
        found.append(stamp.seconds(order))
    return np.array(found)


def _dated(name: str, cell: str) -> Stamp:
    stamp = stamp_of(cell)
    if stamp is None or not stamp.numbers:
        raise FitError(f"--time: {name} has {cell[:40]!r}, which is no time; write it as 2026-01-15T09:30:00")
    return stamp


def _order(name: str, cells: Sequence[str], stamps: Sequence[Stamp]) -> str:
    """The order of day, month and year that dates show."""
    orders = orders_of(stamps)
    if not orders:
        wrong = [next(c for c, s in zip(cells, stamps, strict=True) if not s.fits(one)) for one in ("dmy", "mdy")]
        raise FitError(
            f"--time: {name} has {wrong[0][:40]!r} and {wrong[1][:40]!r}, which are no dates in the same order"
        )
    if len(orders) > 1 and not of_one_day(stamps):
        raise FitError(
            f"--time: {name} has {cells[0][:40]!r}, where day and month cannot be told apart; say "
            f"{' or '.join(f'--date-order {one}' for one in orders)}"
        )
    return orders[0]


def _of_day(name: str, cell: str) -> float:
    stamp = stamp_of(cell)
    if stamp is None or stamp.numbers or stamp.second is None:
        raise FitError(f"--time: {name} has {cell[:40]!r}, which is no time of day; write it as 09:30:00")
    return stamp.second
