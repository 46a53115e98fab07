"""Units in names of columns and in a row under them."""

from __future__ import annotations

import re

_PREFIX = "(?:da|[YZEPTGMkhdcmuµμnpfazy])?"
_BASE = (
    "(?:mHg|H2O|Hz|Pa|psi[adg]?|bar|Torr|torr|ohms?|Ohms?|Ω|deg[CFK]?|rad|rpm|cps|min|sec|lbf?|kgf?|inch|inHg|counts?"
    "|cts|ppm|ppb|pct|FS|RH|rH|dB|°[CFK]?|'[CF]|[smgNVAKWJTCFLlhbdH]|eV|Nm|mol|lx|lux|a\\.u\\.|digits?|LSB|ft|Sv|Bq|%|‰)"
)
_PART = rf"(?:{_PREFIX}{_BASE}|1)(?:\^?-?[0-9²³]|²|³)?"
_UNIT = re.compile(rf"{_PART}(?:[*·./ ]{_PART})*")
_WORDS = re.compile(
    r"(?:milli|micro|kilo|mega|nano)?(?:volts?|amperes?|newtons?|seconds?|minutes?|hours?|celsius|fahrenheit|kelvin|"
    r"percent|grams?|met(?:er|re)s?|pascals?|deg(?:rees?)?(?: ?(?:celsius|c|f|k))?|sekunden?|stunden?|grad|"
    r"[munkµ]?v(?: ?dc| ?ac)|[munkµ]?a(?: ?dc| ?ac)|volts ?(?:dc|ac)|m?sec|msecs?|hpa|k?ohm|k?hz|%rh|% ?r\.?h\.?)",
    re.IGNORECASE,
)
_NONE = re.compile(
    r"TS|RN|text|string|none|no unit|unitless|sequence|index|count(?:er)?|number|no\.?|nr\.?|datetime|date ?time|utc|"
    r"local(?: time)?|bool(?:ean)?|int(?:eger)?|float|clock|A\d{4,}|AO\d+|"
    r"[yMmdDhHsSjT:./ -]{5,25}(?:\.[fs0]+)?",
    re.IGNORECASE,
)
"""Words in a row of units for columns that have none: Campbell Scientific's TS and RN, a kind of value, dd.mm.yyyy."""
_BRACKETED = re.compile(r"[\[(](?!(?!1[\])])[\d.,+-]+[\])]|column \d+\))([^\[\]()]{0,20})[\])]")
_IN_NAME = re.compile(
    r".*?\s*[\[(](?!\d+[\])]|column \d+\))([^\[\]()]{1,15})[\])]\s*|"
    r".*?_([A-Za-z%µΩ]{1,6}[23]?(?:(?:_per_|/)[A-Za-z]{1,5}[23]?)?)"
)


def is_unit(cell: str) -> bool:
    """Whether a cell is a unit by itself: in brackets, or a known one."""
    return bool(
        cell == "#"
        or _BRACKETED.fullmatch(cell)
        or (len(cell) <= 20 and (_UNIT.fullmatch(cell) or _WORDS.fullmatch(cell)))
    )


def no_unit(cell: str) -> bool:
    """Whether a cell of a row of units says that its column has none."""
    return _NONE.fullmatch(cell) is not None


def bare(cell: str) -> str:
    """A unit without its brackets; "" for marks that mean none."""
    inside = _BRACKETED.fullmatch(cell)
    unit = inside[1].strip() if inside else cell
    return "" if unit in ("-", "--", "1", "#") else unit


def unit_in(name: str) -> str:
    """The unit at the end of a name, in brackets or after an underscore; "" if there is none."""
    found = _IN_NAME.fullmatch(name) if len(name) <= 200 else None
    unit = (found[1] or found[2] or "").strip().replace("_per_", "/") if found else ""
    return unit if unit and (is_unit(unit) or (found and found[1])) else ""
