"""Answers to questions: from what a person types, or a file has, to a checked value.

Every function raises `ValueError` with what is wrong and what is possible.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from typing import Any

from rig.fitter.errors import FitError
from rig.fitter.formula import Formula
from rig.procedures.column_names import spelled

Answers = dict[str, Any]
"""Answers by the keys of their questions; options of an instrument as `sets_options.KEY`."""

NONE, UNKNOWN = "none", "unknown"
MODELS: Mapping[str, str] = {
    UNKNOWN: "I do not know: the straight line is taken; `rig trace` says what it lacks",
    "line": "a straight line",
    "parabola": "with a square",
    "cubic": "with a square and a cube",
}
_DEGREES = {UNKNOWN: 1, "line": 1, "parabola": 2, "cubic": 3}
_UNIT = r"[A-Za-z][A-Za-z0-9]*(_per_[A-Za-z][A-Za-z0-9]*)?"
MOST_LEVELS = 1000


def text(given: Any) -> str:
    """One line of text."""
    found = str(given).strip()
    if not found or not found.isprintable():
        raise ValueError("it is one line of text, and not empty")
    return found


def word(given: Any) -> str:
    """A name in files and tables."""
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9]*(_[A-Za-z0-9]+)*", found := str(given).strip()):
        raise ValueError(f"{found!r:.60} is no name: letters, digits and _, a letter first, such as line_pressure")
    return found


def unit(given: Any) -> str:
    """A unit as at the end of column names: `m3/h` is `m3_per_h`."""
    found = str(given).strip().replace("°C", "degC").replace("%", "pct").replace("µ", "u").replace("/", "_per_")
    if not re.fullmatch(_UNIT, found):
        raise ValueError(f"{str(given)!r:.60} is no unit: letters and digits, such as V, kN, degC, m3/h")
    return found


def number(given: Any, low: float, high: float) -> float:
    """A number from `low` to `high`."""
    try:
        found = float(given)
    except (TypeError, ValueError):
        raise ValueError(f"{str(given)!r:.60} is no number; the decimal sign is a point") from None
    if isinstance(given, bool) or not low <= found <= high:
        raise ValueError(f"it is a number from {low:g} to {high:g}")
    return found


def whole(given: Any, low: int, high: int) -> int:
    """A whole number from `low` to `high`."""
    found = number(given, low, high)
    if found != int(found):
        raise ValueError(f"{found:g} is not a whole number")
    return int(found)


def levels(given: Any) -> list[float]:
    """Two settings or more: a list, `0 2 4 10`, or `0 to 10 in 6`."""
    if isinstance(given, str):
        said = given.strip().strip("[]")
        if spaced := re.fullmatch(r"(\S+)\s+to\s+(\S+)\s+in\s+(\d+)", said):
            return _spaced(*spaced.groups())
        items = re.split(r"[\s;]+", re.sub(r",\s+", " ", said).strip())
        if any(re.fullmatch(r"-?\d+,\d+", item) for item in items):
            raise ValueError("the decimal sign is a point, and spaces separate levels: 0.5 1.5")
        given = [item for one in items for item in one.split(",") if item]
    if not isinstance(given, list):
        raise ValueError("it is a list of numbers, or first, last and number of levels: 0 to 10 in 6")
    found = [_plain(number(one, -1e12, 1e12)) for one in given]
    if not 2 <= len(found) <= MOST_LEVELS:
        raise ValueError(f"there are 2 to {MOST_LEVELS} levels, and here {len(found)}: 0 2 4, or 0 to 10 in 6")
    if twice := [one for at, one in enumerate(found) if one in found[:at]]:
        raise ValueError(f"{twice[0]:g} is there twice; the number of replications repeats all levels")
    return found


def two(given: Any) -> list[float]:
    """Two different numbers."""
    found = levels(given)
    if len(found) != 2:
        raise ValueError(f"it is two numbers, that at the lowest level first, and here are {len(found)}")
    return found


def _spaced(first: str, last: str, count: str) -> list[float]:
    low, high, n = number(first, -1e12, 1e12), number(last, -1e12, 1e12), whole(count, 2, MOST_LEVELS)
    if low == high:
        raise ValueError(f"the first and the last level are both {low:g}")
    return [_plain(float(f"{low + (high - low) * k / (n - 1):.10g}")) for k in range(n)]


def _plain(value: float) -> float:
    """A number as a person writes it: 5, not 5.0."""
    return int(value) if value == int(value) else value


def chosen(given: Any, choices: Mapping[str, str]) -> str:
    """One of several names, or its number from 1 on."""
    names, found = list(choices), str(given).strip()
    if found.isdigit() and 1 <= int(found) <= len(names):
        return names[int(found) - 1]
    if found not in names:
        raise ValueError(f"{found!r:.60} is not one of {', '.join(names)}")
    return found


def model(given: Any, factors: Mapping[str, list[float]]) -> str:
    """A model by name, or a formula in the factors that the levels determine."""
    found = text(given)
    if found.isdigit() and 1 <= int(found) <= len(MODELS):
        found = list(MODELS)[int(found) - 1]
    try:
        names = Formula.parse(formula(found, next(iter(factors)))).names
    except FitError as error:
        raise ValueError(f"{error}; or one of {', '.join(MODELS)}") from None
    if other := [name for name in names if name not in factors]:
        raise ValueError(
            f"{other[0]} is neither set nor read by a standard here; a formula has {', '.join(factors)}; or one of "
            f"{', '.join(MODELS)}"
        )
    settings = len(next(iter(factors.values())))
    if _DEGREES.get(found, 0) >= settings:
        raise ValueError(f"{settings} levels do not determine it; choose a simpler one, or more levels")
    return found


def formula(name: str, factor: str) -> str:
    """The formula of a model by name; a formula is its own."""
    if name not in _DEGREES:
        return name
    return " + ".join(["1", factor, *(f"{factor}^{k}" for k in range(2, _DEGREES[name] + 1))])


def option(given: Any, *, is_text: bool) -> Any:
    """An option of a driver, as typed: a text, or a value of TOML."""
    if is_text or not isinstance(given, str):
        return given
    try:
        return tomllib.loads(f"x = {given}")["x"]
    except tomllib.TOMLDecodeError:
        return given


def span(values: list[float], unit_: str) -> str:
    """A range in words."""
    return f"{min(values):g} to {max(values):g} {spelled(unit_)}"
