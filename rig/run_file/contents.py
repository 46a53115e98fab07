"""What a record must hold to mean anything, so that whoever folds a verified run file need not doubt it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from rig.run_file.chain import Record

_Check = Callable[[Any], bool]

_LATEST_S = 2.5e11
"""About the year 9900: a moment beyond has no date."""


def _text(value: Any) -> bool:
    return isinstance(value, str)


def _whole(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and abs(value) < 1 << 62


def _count(value: Any) -> bool:
    return _whole(value) and value >= 0


def _number(value: Any) -> bool:
    return (_whole(value) or isinstance(value, float)) and math.isfinite(value) and abs(value) < _LATEST_S


def _truth(value: Any) -> bool:
    return isinstance(value, bool)


def _texts(value: Any) -> bool:
    return isinstance(value, dict) and all(isinstance(v, str) for v in value.values())


_NEEDED: Mapping[tuple[str, str | None], Mapping[str, _Check]] = {
    ("run", None): {
        "run_id": _text,
        "simulated": _truth,
        "documents": _texts,
        "run_list": _text,
        "points": _count,
        "seed": _whole,
    },
    ("session", None): {"clock_s": _number, "elapsed_s": _number},
    ("skip", "final"): {"reason": _text},
    ("fault", None): {"message": _text},
    ("event", "whole-plot"): {"planned": _count},
    ("event", "rescued"): {"to": _text},
    ("event", "hole"): {"hole_s": _number},
    ("event", "temperatures-left"): {"planned": _count},
    ("event", "whole-plot-lost"): {"first": _count, "count": _count, "reason": _text},
    ("end", None): {"records": _count, "head": _text},
}
_USUAL: Mapping[tuple[str, str | None], Mapping[str, _Check]] = {
    ("run", None): {
        "procedure": _text,
        "bench": _text,
        "dry": _truth,
        "software": _texts,
        "world_start_s": _number,
    },
    ("session", None): {"boot": _text, "gap_s": _number},
    ("event", "whole-plot-lost"): {"doubted_s": _number},
}
_COLUMNS: Mapping[str, _Check] = {
    "session": _count,
    "kind": _text,
    "elapsed_s": _number,
    "utc_s": _number,
    "run_index": lambda v: v is None or _count(v),
    "whole_plot": lambda v: v is None or _count(v),
    "attempt": lambda v: v is None or _count(v),
    "status": lambda v: v is None or _text(v),
    "body": _text,
}


def _plain_observation(record: Record, points: int) -> bool:
    session, kind, elapsed_s, utc_s, index, whole_plot, attempt, status, body = record
    return (
        kind == "observation"
        and (status == "accepted" or status == "rejected")  # noqa: PLR1714 - twice as quick, once a record
        and type(index) is int
        and 0 <= index < points
        and type(elapsed_s) is float
        and -_LATEST_S < elapsed_s < _LATEST_S
        and type(utc_s) is float
        and -_LATEST_S < utc_s < _LATEST_S
        and type(session) is int
        and session >= 0
        and type(body) is str
        and (attempt is None or (type(attempt) is int and attempt >= 0))
        and (whole_plot is None or (type(whole_plot) is int and whole_plot >= 0))
    )


def senseless(record: Record, points: int) -> tuple[str, str] | None:
    """What makes no sense in a record of a run of so many points: (column, sentence); None if all does.

    The body of an observation is not looked into: it is evidence, and whoever reads it checks it.
    """
    if _plain_observation(record, points):  # nearly all of them are
        return None
    for column, holds in _COLUMNS.items():
        value = getattr(record, column)
        if not holds(value):
            return column, f"its {column} cannot be {str(value)[:60]!r}"
    if record.run_index is not None and record.run_index >= points:
        return "run_index", f"there is no point {record.run_index}"
    if record.kind in ("observation", "skip") and record.run_index is None:
        return "run_index", f"{record.kind} of no point"
    if record.kind == "observation" and record.status not in ("accepted", "rejected"):
        return "status", f"an observation cannot be {str(record.status)[:60]!r}"
    if record.kind == "observation":
        return None
    if record.status in ("whole-plot", "whole-plot-lost") and record.whole_plot is None:
        return "whole_plot", f"{record.status} of no whole plot"
    try:
        data = record.data
    except ValueError as error:
        return "body", f"its body is not JSON of ours: {error}"
    for key in ((record.kind, None), (record.kind, record.status)):
        for name, holds in _NEEDED.get(key, {}).items():
            if name not in data or not holds(data[name]):
                return "body", f"its body has no proper {name}"
        for name, holds in _USUAL.get(key, {}).items():
            if name in data and not holds(data[name]):
                return "body", f"its body has no proper {name}"
    if record.status == "whole-plot-lost" and data["first"] + data["count"] > points:
        return "body", "it gives up points that there are not"
    return None
