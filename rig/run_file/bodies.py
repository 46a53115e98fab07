"""Permitted values for the fields of a record's body.

A correct hash does not prove that a controller wrote the record: anybody can compute a hash. A reader of an event gets
values as a controller writes them, or an error that names the record, the field and the defect.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from rig.errors import RunFileError

LATEST_S = 2.5e11
"""About the year 9900, seconds; later times cannot be shown as dates."""
_WHOLE = 1 << 62
_SHOWN = 60


class ContentsError(RunFileError, ValueError):
    """A value in a run file that no controller writes there, even if its hash is right."""


@dataclass(frozen=True)
class Kind:
    """A type of field.

    Attributes:
        words: its description for people: "a number".
        holds: whether a value is of this type.

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
    """Several fields of every observation; checked together if they are as a controller writes them."""
    readings = value.get("readings")
    if type(readings) is not list:
        return False
    if set(map(type, readings)) == {float} and math.isfinite(sum(readings)):
        return True
    return all(map(_finite, readings))


def _chamber(value: Any) -> bool:
    return isinstance(value, dict) and _finite(value.get("temperature_degC"))


def _is_step(value: Any) -> bool:
    if not isinstance(value, dict) or not all(_is_text(value.get(name, "")) for name in ("say", "change", "value")):
        return False
    numbers = (value.get(name) for name in ("timeout_h", "low", "high"))
    named = bool(value.get("say")) and bool(value.get("change"))
    named &= value.get("again", True) is True
    return named and COUNT.holds(value.get("before")) and all(n is None or _finite(n) for n in numbers)


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
VALUES = Kind("a list of numbers", _of_all(_finite))
TABLE = Kind("a table", lambda value: isinstance(value, dict))
CHANNELS = Kind("mean, sd and readings by channel", _by_name(_channel))
CHAMBERS = Kind("a temperature by chamber", _by_name(_chamber))
SPAN = Kind("two numbers of seconds", _arrival)
STEPS = Kind("a list of steps by hand", _of_all(_is_step))
MAYBE_TEXT = Kind("a text or nothing", lambda value: value is None or _is_text(value))
MAYBE_NUMBER = Kind("a number or nothing", lambda value: value is None or _finite(value))
ARRIVALS = Kind("side and start by axis", _by_name(_arrival))
SPANS = Kind("two numbers of seconds by column", _by_name(_arrival))
MOVES = Kind("elapsed seconds and a setting, by axis", _by_name(_arrival))

Text = Annotated[str, TEXT]
Whole = Annotated[int, WHOLE]
Count = Annotated[int, COUNT]
Seconds = Annotated[float, MOMENT]
Number = Annotated[float, NUMBER]
Truth = Annotated[bool, TRUTH]
Texts = Annotated[Mapping[str, str], TEXTS]
Counts = Annotated[Mapping[str, int], COUNTS]
Numbers = Annotated[Mapping[str, float], NUMBERS]
Words = Annotated[Sequence[str], WORDS]
Values = Annotated[Sequence[float], VALUES]
Table = Annotated[Mapping[str, Any], TABLE]
Channels = Annotated[Mapping[str, Mapping[str, Any]], CHANNELS]
Chambers = Annotated[Mapping[str, Mapping[str, Any]], CHAMBERS]
Span = Annotated[Sequence[float], SPAN]
MaybeText = Annotated[str | None, MAYBE_TEXT]
MaybeNumber = Annotated[float | None, MAYBE_NUMBER]
Steps = Annotated[Sequence[Mapping[str, Any]], STEPS]
Arrivals = Annotated[Mapping[str, Sequence[float]], ARRIVALS]
Spans = Annotated[Mapping[str, Sequence[float]], SPANS]
Moves = Annotated[Mapping[str, Sequence[float]], MOVES]
"""Types of the fields of events (`rig.run_file.events`)."""


def shown(value: Any) -> str:
    """A value in an error message, always short."""
    try:
        text = repr(value)
    except (ValueError, RecursionError):  # integers of thousands of digits
        text = type(value).__name__
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}..."
