"""Bodies of records, decoded by types: the one place that says what a field of a record may be.

A hash proves that nobody changed a record without making the hash again, not that it is one of ours. Whoever reads a
field here gets what a controller writes there, or an error that names the record, the field and what is wrong.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from rig.errors import RunFileError

LATEST_S = 2.5e11
"""About the year 9900: a moment beyond has no date."""
_WHOLE = 1 << 62
_SHOWN = 60


class ContentsError(RunFileError, ValueError):
    """Something in a run file is not what a controller writes there, though its hash may be right."""


@dataclass(frozen=True)
class Kind:
    """What a field may be.

    Attributes:
        words: for people: "a number".
        holds: whether a value is one.

    """

    words: str
    holds: Callable[[Any], bool]


def _whole(value: Any) -> bool:
    return type(value) is int and abs(value) < _WHOLE


def _finite(value: Any) -> bool:
    return (type(value) is float and math.isfinite(value)) or _whole(value)


def _of_all(holds: Callable[[Any], bool]) -> Callable[[Any], bool]:
    return lambda value: type(value) is list and all(map(holds, value))


def _by_name(holds: Callable[[Any], bool]) -> Callable[[Any], bool]:
    return lambda value: isinstance(value, dict) and all(map(holds, value.values()))


def _is_text(value: Any) -> bool:
    return type(value) is str


def _channel(value: Any) -> bool:
    return isinstance(value, dict) and _finite(value.get("mean")) and _finite(value.get("sd")) and _readings(value)


def _readings(value: Mapping[str, Any]) -> bool:
    """Of every observation several: looked at together where they are what a controller writes."""
    readings = value.get("readings")
    if type(readings) is not list:
        return False
    if set(map(type, readings)) == {float} and math.isfinite(sum(readings)):
        return True
    return all(map(_finite, readings))


def _chamber(value: Any) -> bool:
    return isinstance(value, dict) and _finite(value.get("temperature_degC"))


def _arrival(value: Any) -> bool:
    return type(value) is list and len(value) == 2 and all(map(_finite, value))


TEXT = Kind("a text", _is_text)
WHOLE = Kind("a whole number", _whole)
COUNT = Kind("a whole number from 0 on", lambda value: _whole(value) and value >= 0)
MOMENT = Kind("a number of seconds", lambda value: _finite(value) and abs(value) < LATEST_S)
NUMBER = Kind("a number", _finite)
TRUTH = Kind("true or false", lambda value: type(value) is bool)
TEXTS = Kind("texts by name", _by_name(_is_text))
COUNTS = Kind("whole numbers by name", _by_name(COUNT.holds))
NUMBERS = Kind("numbers by name", _by_name(_finite))
WORDS = Kind("a list of texts", _of_all(_is_text))
TABLE = Kind("a table", lambda value: isinstance(value, dict))
CHANNELS = Kind("mean, sd and readings by channel", _by_name(_channel))
CHAMBERS = Kind("a temperature by chamber", _by_name(_chamber))
SPAN = Kind("two numbers of seconds", _arrival)
MAYBE_TEXT = Kind("a text or nothing", lambda value: value is None or _is_text(value))
ARRIVALS = Kind("side and start by axis", _by_name(_arrival))

_ANY = "*"
NEEDED: Mapping[tuple[str, str], Mapping[str, Kind]] = {
    ("run", _ANY): {
        "run_id": TEXT,
        "simulated": TRUTH,
        "documents": TEXTS,
        "run_list": TEXT,
        "points": COUNT,
        "seed": WHOLE,
    },
    ("session", _ANY): {"clock_s": MOMENT, "elapsed_s": MOMENT},
    ("skip", "final"): {"reason": TEXT},
    ("fault", _ANY): {"message": TEXT},
    ("event", "whole-plot"): {"planned": COUNT},
    ("event", "rescued"): {"to": TEXT},
    ("event", "hole"): {"hole_s": MOMENT},
    ("event", "temperatures-left"): {"planned": COUNT},
    ("event", "whole-plot-lost"): {"first": COUNT, "count": COUNT, "reason": TEXT},
    ("end", _ANY): {"records": COUNT, "head": TEXT},
}
"""Fields without which a record means nothing."""
_USUAL: Mapping[tuple[str, str], Mapping[str, Kind]] = {
    ("run", _ANY): {"procedure": TEXT, "bench": TEXT, "dry": TRUTH, "software": TEXTS, "world_start_s": MOMENT},
    ("session", _ANY): {
        "boot": TEXT,
        "gap_s": MOMENT,
        "gap_certain": TRUTH,
        "gap_known": TRUTH,
        "pid": COUNT,
        "host": TEXT,
        "wal_frames_dropped": COUNT,
        "wal_commits_lost": COUNT,
        "wal_damage": TEXT,
        "software": TEXTS,
    },
    ("identity", _ANY): {
        **dict.fromkeys(("maker", "model", "serial", "firmware", "asset", "due"), MAYBE_TEXT),
        "confirmed": TRUTH,
    },
    ("skip", _ANY): {"reason": TEXT},
    ("hold", _ANY): {"why": TEXT},
    ("fault", _ANY): {
        **dict.fromkeys(("fault", "where", "error", "state"), TEXT),
        "failure": COUNT,
        "number": COUNT,
        "pause_s": MOMENT,
        "evidence": TABLE,
    },
    ("event", "as-found"): {"restarted": WORDS, "axes": TABLE, "chambers": TABLE},
    ("event", "read-back"): {"restarted": WORDS, "axes": TABLE, "chambers": TABLE},
    ("event", "hole"): {"where": TEXT},
    ("event", "interrupted"): {"signal": TEXT},
    ("event", "not-notified"): {"channel": TEXT, "about": TEXT, "why": TEXT},
    ("event", "recovered"): {"place": TEXT, "failures": COUNTS},
    ("event", "remark"): {"instrument": TEXT, "message": TEXT},
    ("event", "renewing"): {"setpoints_degC": NUMBERS},
    ("event", "safe"): {"seconds": MOMENT, "within_s": MOMENT, "unsafe": WORDS, "silent": WORDS, "found": TABLE},
    ("event", "warning"): {"cause": TEXT, "output": TEXT, "message": TEXT},
    ("event", "whole-plot"): {"setpoints_degC": NUMBERS, "settling": TABLE},
    ("event", "whole-plot-lost"): {"planned": COUNT, "kept": COUNT, "doubted_s": MOMENT},
    ("observation", _ANY): {
        "outputs": CHANNELS,
        "temperatures": CHANNELS,
        "references": CHANNELS,
        "environment": CHAMBERS,
        "readback": NUMBERS,
        "measured_s": SPAN,
        "flags": WORDS,
        "approach": ARRIVALS,
        "settling": TABLE,
        "overload": WORDS,
        "readings": TABLE,
        "lost": TEXT,
    },
    ("end", _ANY): {"accepted": COUNT, "skipped": TEXTS, "whole_plots": COUNT, "lost": TEXTS},
}
_NOTHING: Mapping[str, Kind] = {}


def fields_of(kind: str, status: str | None) -> Mapping[str, Kind]:
    """What the fields of a body are, where they are there."""
    found: Mapping[str, Kind] | None = _FIELDS.get((kind, status or ""))
    return found if found is not None else _FIELDS.get((kind, _ANY), _NOTHING)


_FIELDS = {
    key: {
        **_USUAL.get((key[0], _ANY), _NOTHING),
        **NEEDED.get((key[0], _ANY), _NOTHING),
        **_USUAL.get(key, _NOTHING),
        **NEEDED.get(key, _NOTHING),
    }
    for key in {*NEEDED, *_USUAL}
}


class Body(dict[str, Any]):
    """A record's body. Reading a field checks it: raises `ContentsError` naming record and field."""

    __slots__ = ("_fields", "_where")

    def __init__(self, decoded: Mapping[str, Any], kind: str, status: str | None, where: Callable[[], str]) -> None:
        super().__init__(decoded)
        self._fields, self._where = fields_of(kind, status), where

    def __getitem__(self, name: str) -> Any:
        """A field that has to be there."""
        value = super().__getitem__(name)
        kind = self._fields.get(name)
        if kind is not None and not kind.holds(value):
            raise ContentsError(f"{self._where()}: its {name} cannot be {shown(value)}, it has to be {kind.words}")
        return value

    def __missing__(self, name: str) -> Any:
        raise ContentsError(f"{self._where()} has no {name}")

    def get(self, name: str, default: Any = None) -> Any:
        """A field, or something else where it is not there."""
        if name not in self:
            return default
        return self[name]


def shown(value: Any) -> str:
    """A value in an error, short whatever it is."""
    try:
        text = repr(value)
    except (ValueError, RecursionError):  # whole numbers of thousands of digits
        text = type(value).__name__
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}..."


def body_of(text: object, kind: str, status: str | None, where: Callable[[], str]) -> Body:
    """A body decoded. Raises `ContentsError` where it is no JSON object."""
    if not isinstance(text, str):
        raise ContentsError(f"{where()}: its body is no text")
    try:
        decoded = json.loads(text)
    except RecursionError:
        raise ContentsError(f"{where()}: its body is JSON nested too deeply") from None
    except ValueError as error:
        raise ContentsError(f"{where()}: its body is not JSON: {error}") from error
    if not isinstance(decoded, dict):
        raise ContentsError(f"{where()}: its body is JSON, but not an object")
    return Body(decoded, kind, status, where)
