"""Dates and times of day written as text, as seconds."""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import UTC, datetime

import numpy as np

from fitter.arrays import FloatArray
from fitter.errors import FitError

_LOCAL = re.compile(r"(\d{1,2})([./-])(\d{1,2})\2(\d{4})(?:[ T,]+(.+))?")
_CLOCK = re.compile(r"(\d{1,2}):(\d{2})(?::(\d{2})(?:[.,:](\d{1,9}))?)? ?([AaPp][Mm])?")
_DAY_S = 86400.0


def is_clock(cells: Sequence[str]) -> bool:
    """Whether all texts are dates or times of day, in some order."""
    return bool(len(cells)) and all(_iso(c) is not None or _LOCAL.fullmatch(c) or _CLOCK.fullmatch(c) for c in cells)


def seconds_of(
    name: str, cells: Sequence[str], dates: Sequence[str] | None = None, order: str | None = None
) -> FloatArray:
    """Seconds since the first row.

    Args:
        name: of the column, for messages.
        cells: (n,) dates with times, dates, or times of day.
        dates: (n,) dates of the times of day, if they have a column of their own.
        order: "dmy" or "mdy" for dates such as 03/04/2026; None if they must show it: by a number above 12, by dots
            between them (dmy), or since all are of one day.

    Raises:
        FitError: a text is not a date or a time, or a date can be read in two ways.
    """
    if dates is not None:
        days = _days(name, dates, order)
        seconds = np.array([_of_day(name, cell) for cell in cells]) + days
        return np.asarray(seconds - seconds[0])
    if all(_CLOCK.fullmatch(cell) for cell in cells):
        found = np.array([_of_day(name, cell) for cell in cells])
        if (np.diff(found) < 0).any():
            raise FitError(f"--time: {name} has times of day that go back, as over midnight; name the date with --date")
        return np.asarray(found - found[0])
    found = _days(name, cells, order)
    return np.asarray(found - found[0])


def _days(name: str, cells: Sequence[str], order: str | None) -> FloatArray:
    """Seconds of dates, with or without a time of day."""
    if all(_iso(cell) is not None for cell in cells):
        stamps = [_iso(cell) for cell in cells]
        aware = {stamp.tzinfo is not None for stamp in stamps if stamp is not None}
        if len(aware) > 1:
            raise FitError(f"{name}: some times have a zone and others have none; write all of them alike")
        return np.array([(s if s.tzinfo else s.replace(tzinfo=UTC)).timestamp() for s in stamps if s is not None])
    parts = [_LOCAL.fullmatch(cell) for cell in cells]
    for cell, part in zip(cells, parts, strict=True):
        if part is None:
            raise FitError(f"--time: {name} has {cell[:40]!r}, which is no time; write it as 2026-01-15T09:30:00")
    days = [(int(p[1]), int(p[3])) for p in parts if p is not None]
    one_day = len({(p[1], p[3], p[4]) for p in parts if p is not None}) == 1
    if order is None and (one_day or all(p[2] == "." for p in parts if p is not None)):
        order = "mdy" if any(day[1] > 12 for day in days) else "dmy"
    first, second = (any(day[i] > 12 for day in days) for i in (0, 1))
    if order is None:
        if first == second:
            raise FitError(
                f"--time: {name} has {cells[0][:40]!r}, where day and month cannot be told apart; say "
                "--date-order dmy or --date-order mdy"
            )
        order = "dmy" if first else "mdy"
    found = []
    for cell, part in zip(cells, parts, strict=True):
        if part is None:
            continue
        day, month = (part[1], part[3]) if order == "dmy" else (part[3], part[1])
        try:
            date = datetime(int(part[4]), int(month), int(day), tzinfo=UTC)
        except ValueError:
            raise FitError(f"--time: {name} has {cell[:40]!r}, which is no date in the order {order}") from None
        found.append(date.timestamp() + (_of_day(name, part[5]) if part[5] else 0.0))
    return np.array(found)


def _iso(cell: str) -> datetime | None:
    """A time as in ISO 8601; None if it is none. A decimal comma is allowed."""
    if len(cell) < 10 or cell[4:5] != "-":
        return None
    try:
        return datetime.fromisoformat(cell.replace(",", "."))
    except ValueError:
        return None


def _of_day(name: str, cell: str) -> float:
    found = _CLOCK.fullmatch(cell.strip())
    if found is None:
        raise FitError(f"--time: {name} has {cell[:40]!r}, which is no time of day; write it as 09:30:00")
    hour, half = int(found[1]), (found[5] or "").lower()
    if half:
        hour = hour % 12 + (12 if half == "pm" else 0)
    seconds = float(f"{found[3] or 0}.{found[4] or 0}")
    value = hour * 3600.0 + int(found[2]) * 60.0 + seconds
    if value > _DAY_S or int(found[2]) > 59:
        raise FitError(f"--time: {name} has {cell[:40]!r}, which is no time of day; write it as 09:30:00")
    return value
