"""Required contents of a record, checked before a run file is folded."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from rig.run_file.bodies import COUNT, LATEST_S, MOMENT, TEXT, ContentsError, shown
from rig.run_file.chain import Record
from rig.run_file.events.points import ACCEPTED, REJECTED, Observed, Skipped, WholePlotBegan, WholePlotLost

_Check = Callable[[Any], bool]

_COLUMNS: Mapping[str, _Check] = {
    "session": COUNT.holds,
    "kind": TEXT.holds,
    "elapsed_s": MOMENT.holds,
    "utc_s": MOMENT.holds,
    "run_index": lambda v: v is None or COUNT.holds(v),
    "whole_plot": lambda v: v is None or COUNT.holds(v),
    "attempt": lambda v: v is None or COUNT.holds(v),
    "status": lambda v: v is None or TEXT.holds(v),
    "body": TEXT.holds,
}


def _plain_observation(record: Record, points: int) -> bool:
    session, kind, elapsed_s, utc_s, index, whole_plot, attempt, status, body = record
    return (
        kind == Observed.kind
        and (status == ACCEPTED or status == REJECTED)  # noqa: PLR1714, SIM109 - twice as fast, and called for every
        # record
        and type(index) is int
        and 0 <= index < points
        and type(elapsed_s) is float
        and -LATEST_S < elapsed_s < LATEST_S
        and type(utc_s) is float
        and -LATEST_S < utc_s < LATEST_S
        and type(session) is int
        and session >= 0
        and type(body) is str
        and (attempt is None or (type(attempt) is int and attempt >= 0))
        and (whole_plot is None or (type(whole_plot) is int and whole_plot >= 0))
    )


def wrong_column(record: Record) -> tuple[str, str] | None:
    """The first of a record's own columns with an impossible value: (column, sentence); None if there is none."""
    for column, holds in _COLUMNS.items():
        value = getattr(record, column)
        if not holds(value):
            return column, f"its {column} cannot be {shown(value)}"
    return None


def senseless(record: Record, points: int) -> tuple[str, str] | None:
    """The first inconsistent column of a record, given the run's number of points: (column, sentence); None if there is
    none.

    The body of an observation is not checked here: it is evidence, and its reader checks it.
    """
    if _plain_observation(record, points):  # nearly all of them are
        return None
    if (wrong := wrong_column(record)) is not None:
        return wrong
    if record.run_index is not None and record.run_index >= points:
        return "run_index", f"there is no point {record.run_index}"
    if record.kind in (Observed.kind, Skipped.kind) and record.run_index is None:
        return "run_index", f"{record.kind} of no point"
    if record.kind == Observed.kind:
        known = record.status in (ACCEPTED, REJECTED)
        return None if known else ("status", f"an observation cannot be {str(record.status)[:60]!r}")
    try:
        event = record.event
    except ContentsError as error:
        return "body", str(error).partition(": ")[2]
    if isinstance(event, WholePlotBegan | WholePlotLost) and record.whole_plot is None:
        return "whole_plot", f"{record.status} of no whole plot"
    if isinstance(event, WholePlotLost) and event.points.stop > points:
        return "body", "it gives up points that there are not"
    return None
