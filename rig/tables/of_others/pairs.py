"""Logs that write the name of each value beside it: "t=0 lux=12.5", "T: 20.5 C, U: 0.125 V", {"t": 0, "T": 20.5}."""

from __future__ import annotations

import re
from collections.abc import Sequence

from rig.tables.of_others.cells_of_lines import Line
from rig.tables.of_others.numbers import is_time, looks_like_number, with_unit

_PAIR = re.compile(
    r"\"?(?P<name>[A-Za-z_\u00c0-\uffff][\w.%/-]{0,40})\"?\s*(?P<sign>[=:])\s*"
    r"(?P<value>[+-]?(?:\d[\d.,]*\d|\d|\.\d+)(?:[eE][+-]?\d+)?(?: ?[A-Za-z%\u00b0\u00b5\u03a9/]{1,6}(?![\w=:]))?)"
)
_MOSTLY, _FEWEST, _FIRST, _LONGEST = 0.8, 2, 40, 2000


def with_pairs(lines: Sequence[Line]) -> tuple[tuple[str, ...], list[Line]] | None:
    """Names, and lines of their values with tabs between; None for a file that is no such log.

    Every line has the same names, or some of them; other lines, such as "ready", are no part of the table. A log is
    recognised where nearly all lines have two pairs of a name and a number or more, and nothing else but signs and a
    time before them.
    """
    plain = [line for line in lines if not line.remark]
    if sum(len(_pairs(line.text)) >= _FEWEST for line in plain[:_FIRST]) < _MOSTLY * len(plain[:_FIRST]):
        return None
    found = [(line, _pairs(line.text)) for line in plain]
    kept = [(line, pairs) for line, pairs in found if len(pairs) >= _FEWEST]
    if len(kept) < _FEWEST or len(kept) < _MOSTLY * len(plain):
        return None
    names = tuple(dict.fromkeys(name for _, pairs in kept for name in pairs))
    return names, [
        Line(line.row, "\t".join(pairs.get(name, "") for name in names), False, line.apart) for line, pairs in kept
    ]


def _pairs(text: str) -> dict[str, str]:
    """Values by name; {} for a line with anything else in it, or a name that comes twice."""
    if len(text) > _LONGEST:
        return {}
    found = list(_PAIR.finditer(text))
    rest = _PAIR.sub("", text)
    names = [one["name"] for one in found]
    time = rest.strip(" \t,;|[](){}-")
    if len(set(names)) < len(names) or (any(sign.isalnum() for sign in time) and (time in names or not is_time(time))):
        return {}
    values = [one["value"].rstrip(".,") for one in found]
    first = {"time": time} if any(sign.isalnum() for sign in time) and "time" not in names else {}
    return first | dict(zip(names, values, strict=True)) if all(map(_is_number, values)) else {}


def _is_number(cell: str) -> bool:
    return looks_like_number(cell) or bool(with_unit(cell)[0])
