"""Numbers as others write them: decimal point or comma, groups of three digits, words for a missing value."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from rig.errors import UsageError
from rig.fitter.arrays import FloatArray
from rig.procedures.tables.dates import stamp_of
from rig.units.in_tables import is_unit

MISSING = frozenset(("", "na", "n/a", "#n/a", "#nv", "nan", "null", "-", "--", "---", "\u2013", "\u2014"))
"""Words for a missing value, in lower case."""
_NEVER_LAST = "012345689"
"""Digits at the end of most numbers, and of no cell that says that there is no value."""
_NO_READING = re.compile(
    r"[+-]?(?:O\.?L\.?|OVL|OVLD|OVRG|OVF|OFL|UFL|OVER(?:[ _-]?(?:LOAD|RANGE|FLOW))?|UNDER(?:[ _-]?(?:RANGE|FLOW))?|"
    r"OUT OF RANGE|BURN[ -]?OUT|OPEN|ERR(?:OR)?|INVALID|FAULT|NO (?:DATA|READING)|BAD|\u221e)|"
    r"[+]{3,}|[*]{3,}|-{4,}|_{3,}|>{2,}|<{2,}|#{3,}|\?{2,}",
    re.IGNORECASE,
)
"""What meters and loggers write in place of a reading. In a column of numbers it is none; elsewhere it is a word."""
_EXPONENT = r"(?:[eEdD][+-]?\d{1,4})?"
_SPACES = " \u00a0\u202f\u2009"
_PLAIN = re.compile(rf"[+-]?(?:\d+|\d+(?P<d>[.,])\d*|(?P<b>[.,])\d+){_EXPONENT}")
_GROUPED = re.compile(rf"[+-]?\d{{1,3}}(?:(?P<g>[.,'\u2019{_SPACES}])\d{{3}})(?:(?P=g)\d{{3}})*(?:(?P<d>[.,])\d*)?")
_EITHER = re.compile(r"[+-]?[1-9]\d{0,2}[.,]\d{3}")
_ENDLESS = re.compile(r"[+-]?(?:inf|infinity)", re.IGNORECASE)
_SIMPLE = re.compile(r"[+-]?[0-9]+(?:\.[0-9]*)?")
"""Most cells; it is asked first, because it is quick."""
_LONGEST, _LONG = 400, 40
_WITH_UNIT = re.compile(r"([+\u2212-]?\s*[\d.,]*\d(?:[eE][+-]?\d+)?)(\s*)([^\s\d.,+-].*)")
_WITH_ERROR = re.compile(
    r"([+\u2212-]?(?:\d+(?:[.,](\d*))?|[.,](\d+)))\s*(?:\((\d+|\d*[.,]\d+)\)|(?:\u00b1|\+/?-)\s*([\d.,]*\d))"
)
_APART = re.compile(r"^([+-])\s+(?=[\d.,])")
_NINES = frozenset(
    [sign * v for v in (9999.0, 99999.0, 999999.0, 9999999.0, 9999.9, 9999.99, 6999.0, 7999.0) for sign in (-1.0, 1.0)]
    + [-999.0, -999.9, -999.99]
)
"""Numbers that loggers write for no value: nines, and 6999 and 7999 of Campbell Scientific."""
_FULL, _NEAR, _LARGEST = np.array([9.9e37, 9.91e37, 1e38, 3.4028235e38]), 1e-6, 1e30
"""Overloads, and the largest number of single precision; how near; and what no other value of the column reaches."""
_DISTINCT, _AWAY, _HUGE = 3, 5.0, ("37", "38")
OVERLOAD = 9.9e37
"""What instruments with SCPI send for a reading beyond the range; 9.91e37 for none (SCPI-99, volume 1, 7.2.1.4)."""
_OVERLOAD = re.compile(r"[+-]?9\.9(?:0*|10*)[eE]\+?37")

_MOSTLY = 0.8
"""Share of a column's cells that have its unit."""


def is_missing(cell: str) -> bool:
    """Whether a cell says that there is no value."""
    if cell[-1:] in _NEVER_LAST:
        return not cell
    return cell.lower() in MISSING or is_overload(cell)


def is_overload(cell: str) -> bool:
    """Whether a cell is what an instrument sends in place of a reading."""
    return cell.endswith("37") and _OVERLOAD.fullmatch(cell) is not None


def maybe_gap(cell: str) -> bool:
    """Whether a cell may be a number that loggers write for no value; the other values of its column decide."""
    return "999" in cell or cell[-2:] in _HUGE


def may_have_gaps(low: FloatArray, high: FloatArray) -> bool:
    """Whether the smallest or the largest values of columns may stand for none; no other one stands apart."""
    return any(one in _NINES or abs(one) >= OVERLOAD for one in (*low.tolist(), *high.tolist()))


def gaps_of(values: FloatArray) -> list[float]:
    """Numbers of a column that stand for no value: such as 1E38 above all others, and -9999 if it stands apart.

    It does where no other value is negative, or where it is five times the range of the others away from them; and
    where it is in less than a third of the rows, and not there with the other sign.

    Args:
        values: (n,) of a column; NaN for missing ones.
    """
    known = values[np.isfinite(values)]
    if not known.size or not may_have_gaps(known.min(keepdims=True), known.max(keepdims=True)):
        return []
    size = np.abs(known)
    full = np.any(np.abs(size[:, None] - _FULL) <= _NEAR * _FULL, axis=1) if (size >= OVERLOAD).any() else size < 0.0
    huge: list[float] = np.unique(known[full]).tolist() if (size[~full] < _LARGEST).all() else []
    known = known[~full]
    found = np.unique(known[np.isin(known, list(_NINES))])
    others = known[~np.isin(known, found)]
    if found.size != 1 or 3 * (known.size - others.size) >= known.size or np.unique(others).size < _DISTINCT:
        return huge
    one, low, high = float(found[0]), float(others.min()), float(others.max())
    away = max(low - one, one - high)
    apart = (one < 0.0 <= low) or away > _AWAY * (high - low)
    return [*huge, one] if apart else huge


def is_no_reading(cell: str) -> bool:
    """Whether a cell has a word or signs that instruments write in place of a number."""
    return len(cell) < _LONG and not cell[-1:].isdigit() and _NO_READING.fullmatch(cell) is not None


@lru_cache(maxsize=1 << 12)
def with_unit(cell: str) -> tuple[str, str]:
    """A cell such as "12.5 g" as number and unit; ("", "") for any other."""
    found = _WITH_UNIT.fullmatch(cell) if len(cell) < _LONG and not with_error(cell)[0] else None
    if found is None or not looks_like_number(found[1]) or not is_unit(found[3]):
        return "", ""
    return (found[1], found[3]) if found[2] or len(found[3]) > 1 or not found[3].isalpha() else ("", "")


@lru_cache(maxsize=1 << 12)
def with_error(cell: str) -> tuple[str, str]:
    """A cell such as "1.141(50)" as number and standard uncertainty (GUM, 7.2.2), which is that of its last digits.

    "" for what stands behind a sign as in "1.141 +- 0.1": it may be an expanded one. ("", "") for any other cell.
    """
    found = _WITH_ERROR.fullmatch(cell) if len(cell) < _LONG else None
    if found is None:
        return "", ""
    if found[4] is None or not found[4].isdigit():
        return found[1], found[4] or ""
    places = len(found[2] or found[3] or "")
    digits = found[4].rjust(places + 1, "0")
    sign = "," if "," in found[1] else "."
    return found[1], f"{digits[:-places]}{sign}{digits[-places:]}" if places else digits


def looks_like_number(cell: str) -> bool:
    """Whether a cell is a number in some notation."""
    if len(cell) < _LONG and _SIMPLE.fullmatch(cell):
        return True
    text = minus(cell)
    if len(text) > _LONGEST:
        return False
    return any(one.fullmatch(text) for one in (_PLAIN, _GROUPED, _ENDLESS))


def is_value(cell: str) -> bool:
    """Whether a cell is a number, a time or a missing value, in some notation."""
    return (
        is_missing(cell)
        or looks_like_number(cell)
        or is_time(cell)
        or is_no_reading(cell)
        or bool(with_unit(cell)[0])
        or bool(with_error(cell)[0])
    )


def is_time(cell: str) -> bool:
    """Whether a cell is a date or a time of day."""
    return stamp_of(cell) is not None


def minus(cell: str) -> str:
    """A cell with the plain minus sign, and without blanks after its sign."""
    text = cell.replace("\u2212", "-") if "\u2212" in cell else cell
    return _APART.sub(r"\1", text) if text[1:2].isspace() else text


@dataclass(frozen=True)
class Notation:
    """How numbers are written.

    Attributes:
        decimal: "." or ",".
        grouped: an example of a number with groups of digits; "" if there was none.
        why: what shows the decimal sign, where the numbers alone do not; "" where they do.
    """

    decimal: str = "."
    grouped: str = ""
    why: str = ""

    def number(self, cell: str) -> float | None:
        """The value of a cell; None if it is not a number. May be infinite, and NaN is not a number."""
        if self.decimal == "." and len(cell) < _LONG and _SIMPLE.fullmatch(cell):
            return float(cell)
        text = minus(cell)
        if _ENDLESS.fullmatch(text):
            return float(text)
        if len(text) > _LONGEST:
            return None
        other = "," if self.decimal == "." else "."
        if (found := _PLAIN.fullmatch(text)) and other not in (found["d"], found["b"]):
            if self.decimal == "," and text.endswith(","):
                return None
            return float(text.replace(",", ".").replace("D", "e").replace("d", "e"))
        found = _GROUPED.fullmatch(text)
        if found and found["g"] != self.decimal and found["d"] in (None, self.decimal):
            whole, _, rest = text.partition(self.decimal)
            return float(f"{whole.replace(found['g'], '')}.{rest}")
        return None


def notation_of(
    cells: Iterable[tuple[int, str]], separator: str, name: str, asked: str = "", *, dotted: bool = False
) -> Notation:
    """The notation of all numbers of a file.

    Args:
        cells: (row, cell) of every cell that may be a number.
        separator: between cells.
        name: of the file, for messages.
        asked: the declared decimal sign; "" to recognise it.
        dotted: whether the file has dates with dots: where those are written, a comma separates no groups of digits.

    Raises:
        UsageError: both signs are decimal, or "1,234" may be 1.234 or 1234.
    """
    sure: dict[str, tuple[int, str]] = {}
    either: dict[str, tuple[int, str]] = {}
    grouped = ""
    for row, cell in cells:
        if cell.isdigit() or len(cell) > _LONGEST:
            continue
        text = minus(cell)
        if _EITHER.fullmatch(text):
            either.setdefault("," if "," in text else ".", (row, cell))
        elif found := _PLAIN.fullmatch(text):
            sign = found["d"] or found["b"]
            if sign:
                sure.setdefault(sign, (row, cell))
        elif found := _GROUPED.fullmatch(text):
            grouped = grouped or cell
            if found["d"] and found["d"] != found["g"]:
                sure.setdefault(found["d"], (row, cell))
            elif found["g"] in ".,":  # two groups or more
                sure.setdefault("," if found["g"] == "." else ".", (row, cell))
    if asked:
        other = either.get("," if asked == "." else ".")
        return Notation(asked, grouped or (other[1] if other else ""))
    if len(sure) == 2:
        (row, cell), (other_row, other_cell) = sure["."], sure[","]
        raise UsageError(
            f"{name}: {cell} in row {row} has a decimal point, {other_cell} in row {other_row} a decimal comma; say "
            f"--decimal point or --decimal comma"
        )
    if sure:
        decimal = next(iter(sure))
        other = either.get("," if decimal == "." else ".")
        return Notation(decimal, grouped or (other[1] if other else ""))
    if dotted and "," in either and "." not in either and separator != ",":
        return Notation(",", grouped, "as beside dates with dots")
    if "," in either or ("." in either and separator == ";"):
        row, cell = either.get(",") or either["."]
        raise UsageError(
            f"{name}, row {row}: {cell} may be {cell.replace(',', '.')} or {cell.replace(',', '').replace('.', '')}; "
            f"say --decimal point or --decimal comma"
        )
    return Notation(".", grouped)


def without_units(rows: Sequence[Sequence[str]], count: int) -> tuple[list[list[str]], dict[int, str]]:
    """Rows without the units in their cells, such as "12.5 g", and the unit of each column that has one in its cells.

    A column keeps its text where cells have different units, or more than a few have none.
    """
    found: dict[int, str] = {}
    for column in range(count):
        cells = (row[column] for row in rows if column < len(row))
        if not with_unit(next((cell for cell in cells if not is_missing(cell)), ""))[0]:
            continue
        given = [row[column] for row in rows if column < len(row) and not is_missing(row[column])]
        pairs = [with_unit(cell) for cell in given]
        units = {unit for _, unit in pairs if unit}
        if len(units) == 1 and sum(bool(unit) for _, unit in pairs) >= _MOSTLY * len(pairs):
            found[column] = units.pop()
    if not found:
        return list(map(list, rows)), found
    return [[with_unit(cell)[0] or cell if i in found else cell for i, cell in enumerate(row)] for row in rows], found


def without_errors(rows: Sequence[Sequence[str]], count: int) -> tuple[list[list[str]], dict[int, list[str]]]:
    """Rows without the uncertainties in their cells, and those of each column in which every value has one."""
    found: dict[int, list[str]] = {}
    for column in range(count):
        cells = [row[column] if column < len(row) else "" for row in rows]
        if all(is_missing(cell) or with_error(cell)[0] for cell in cells) and not all(map(is_missing, cells)):
            found[column] = [with_error(cell)[1] for cell in cells]
    if not found:
        return list(map(list, rows)), found
    return [[with_error(cell)[0] or cell if i in found else cell for i, cell in enumerate(row)] for row in rows], found
