"""Rows under a table that are no observations: averages, totals, signatures, remarks.

A row is left out where its cells or its arithmetic show what it is; it is named in what was understood. Where a word
like "Average" stands in a column of text and the numbers beside it are no average, the file is refused.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rig.errors import UsageError
from rig.fitter.arrays import FloatArray
from rig.tables.of_others.numbers import Notation, is_missing, looks_like_number
from rig.tables.of_others.where_the_table_is import is_value

_OF = r"(?:\s*\(.*\)|\s+of .*|\s*[:=].*|\.)?"
_WORDS = {
    "mean": "(?:arithmetic |overall |grand )?(?:average|avg|ave|mean|mean value)|mittel(?:wert)?|durchschnitt|moyenne|"
    "media|promedio|média|gemiddelde|medel(?:värde)?|среднее|平均值?",
    "sd": r"st(?:d|an?dard|\.)?\.? ?dev(?:iation|\.)?|std|s\.?d|sigma|σ|stabw|standardabweichung|[ée]cart[- ]type|"
    r"desv(?:iación|\.)? est(?:ándar|\.)?|deviazione standard|sample standard deviation",
    "sum": "(?:grand |sub-? ?)?totals?|sum|(?:gesamt)?summe|gesamt|somme|suma|somma|totale|totaal|summa|合计",
    "variance": "variance|var|varianz|varianza",
    "median": "median|médiane|mediana|zentralwert",
    "rsd": r"%? ?(?:rsd|cv|c\.v)|rel(?:ative|\.) st(?:d|andard)\.? dev(?:iation|\.)?|coefficient of variation",
    "sem": r"standard error(?: of the mean)?|std\.? err(?:or|\.)?|sem|se",
    "min": "min(?:imum)?|mínimo",
    "max": "max(?:imum)?|máximo",
    "range": "range|spannweite",
    "count": "count|n|anzahl|no\\.? of readings",
}
_SURE = frozenset(("mean", "sd", "sum", "variance", "median", "rsd", "sem"))
"""Words that name no setting: in a column of numbers they need no arithmetic."""
_LABEL = {kind: re.compile(f"(?:{words}){_OF}", re.IGNORECASE) for kind, words in _WORDS.items()}
_LONGEST, _SHORT, _MOST = 60, 3, 50
_ENOUGH, _NEARLY = 3, 0.8
Flags = np.ndarray[Any, np.dtype[np.bool_]]


def label_of(cell: str) -> str:
    """The statistic that a cell names, as in `_WORDS`; "" if it names none."""
    if not cell or len(cell) > _LONGEST or looks_like_number(cell):
        return ""
    return next((kind for kind, words in _LABEL.items() if words.fullmatch(cell)), "")


@dataclass
class _Rows:
    """Rows of a table, and those of them that are no observations.

    Attributes:
        cells: of the rows.
        apart: whether a blank line or an empty row stands before each row.
        notation: of its numbers.
        labelled: column of a word for a statistic, by index of the row.
        found: cell that shows what a row is, by index of the row.
    """

    cells: Sequence[Sequence[str]]
    apart: Sequence[bool]
    notation: Notation
    labelled: Mapping[int, int]
    found: dict[int, str] = field(default_factory=dict)
    _known: dict[int, tuple[Flags, Flags]] = field(default_factory=dict)

    def observed(self, end: int, begin: int = 0) -> Iterator[int]:
        """Rows before another that may be observations."""
        return (i for i in range(begin, end) if i not in self.labelled and i not in self.found)

    def of_numbers(self, column: int, end: int) -> bool:
        """Whether nearly all cells of a column are values, in the rows before another one."""
        given, values = self._flags(column)
        rows = np.ones(end, np.bool_)
        rows[[i for i in (*self.labelled, *self.found) if i < end]] = False
        count = int(np.sum(rows & given[:end]))
        return count >= _ENOUGH and int(np.sum(rows & values[:end])) >= _NEARLY * count

    def _flags(self, column: int) -> tuple[Flags, Flags]:
        """(n,) whether a column has a cell that does not say that there is no value, and whether that is a value."""
        if column not in self._known:
            cells = [_cell(row, column) for row in self.cells]
            given = np.array([bool(cell) and not is_missing(cell) for cell in cells], np.bool_)
            known = {cell: is_value(cell) for cell in set(cells)}
            values = np.array([there and known[cell] for cell, there in zip(cells, given, strict=True)], np.bool_)
            self._known[column] = given, values
        return self._known[column]


def labelled_rows(rows: Sequence[Sequence[str]]) -> dict[int, int]:
    """Column of the first word for a statistic, by index of the row."""
    known: dict[str, bool] = {}
    found: dict[int, int] = {}
    for i, row in enumerate(rows):
        for column, cell in enumerate(row):
            if not cell or cell[0].isdigit() or cell[0] in "+-.":
                continue
            if cell not in known:
                known[cell] = bool(label_of(cell))
            if known[cell]:
                found[i] = column
                break
    return found


def footers(
    names: Sequence[str], rows: Sequence[Sequence[str]], apart: Sequence[bool], notation: Notation,
    where: Callable[[int], str],
) -> dict[int, str]:  # fmt: skip
    """Rows that are no observations: a cell that shows it, by index of the row.

    Args:
        names: of the columns.
        rows: cells of the table under its names, and under its row of units.
        apart: whether a blank line or an empty row stands before each row.
        notation: of the numbers of the file.
        where: file and row for messages, of the row with an index.

    Raises:
        UsageError: a row is called an average, and it is none.
    """
    labelled = labelled_rows(rows)
    table = _Rows(rows, apart, notation, labelled)
    if len(names) > 1 and not all(map(is_value, names)):
        table.found |= {i: "the names again" for i, row in enumerate(rows) if list(row) == list(names)}
    _remarks(table)
    if labelled and len(labelled) < len(rows) and len(labelled) <= _MOST:
        _summaries(table, where)
    _remarks(table)
    _unnamed(table)
    return dict(sorted(table.found.items()))


def _remarks(table: _Rows) -> None:
    """Rows at the end that have words where others have numbers: without any number, or after a blank line."""
    end = len(table.cells)
    while end and end - 1 in table.found:
        end -= 1
    words: dict[int, list[int]] = {}
    for i in range(end - 1, max(-1, end - 1 - _MOST), -1):
        columns = [column for column, cell in enumerate(table.cells[i]) if cell and not is_value(cell)]
        if not columns or i in table.labelled:
            break
        words[i] = columns
    for first in sorted(words):
        rows = range(first, end)
        spoken_in = {column for i in rows for column in words[i]}
        counts = {column for column in spoken_in if table.of_numbers(column, first)}
        known = all(counts.intersection(words[i]) for i in rows)
        spoken = all(any(table.apart[first : i + 1]) or not any(map(looks_like_number, table.cells[i])) for i in rows)
        if known and spoken:
            table.found |= {i: table.cells[i][words[i][0]] for i in rows}
            return


def _summaries(table: _Rows, where: Callable[[int], str]) -> None:
    """Rows with the name of a statistic. Raises `UsageError`."""
    last = max((i for i in range(len(table.cells)) if i not in table.labelled and i not in table.found), default=-1)
    begin = 0
    called: dict[tuple[int, str], dict[int, bool]] = {}
    for i, column in table.labelled.items():
        if i - 1 not in table.labelled:
            begin = next((j + 1 for j in range(i - 1, -1, -1) if j in table.labelled), 0)
        row, kind = table.cells[i], label_of(table.cells[i][column])
        groups = [list(table.observed(i, start)) for start in {0, begin}]
        called.setdefault((column, kind), {})[i] = any(_holds(table, row, kind, g, wholly=i < last) for g in groups)
    for (column, kind), rows in called.items():
        i = max(rows)
        label = table.cells[i][column]
        sure = kind in _SURE and min(rows) > last and not any(table.cells[i][:column])
        if all(rows.values()) or (sure and table.of_numbers(column, i)):
            table.found |= {i: table.cells[i][column] for i in rows}
        elif sure and last + 1 >= _ENOUGH and len(label) > _SHORT:
            raise UsageError(
                f"{where(i)}: it is called {label[:40]!r}, and its numbers are no such summary of the rows above; "
                "remove the row, or give it another name"
            )


def _unnamed(table: _Rows) -> None:
    """Rows at the end without a name: all of their numbers are means, sums or deviations of the rows above."""
    end = len(table.cells)
    while end and end - 1 in table.found:
        end -= 1
    for i in range(max(end - 2, _ENOUGH), end):
        row = table.cells[i]
        above = list(table.observed(i))
        blank = [c for c in range(max(map(len, table.cells))) if not _cell(row, c)]
        full = [c for c in blank if above and all(_cell(table.cells[j], c) for j in above)]
        given = [cell for cell in row if cell]
        whole = any(table.apart[i - 1 : i + 1]) and len(given) > 1  # a row of its own, after a blank line
        if len(above) < _ENOUGH or not (full or whole) or not given or not all(map(looks_like_number, given)):
            continue
        kinds = [kind for kind in ("mean", "sum", "sd") if _holds(table, row, kind, above, wholly=True)]
        if kinds:
            table.found[i] = f"a {kinds[0]} without a name" if kinds[0] != "sd" else "a deviation without a name"


def _holds(table: _Rows, row: Sequence[str], kind: str, above: Collection[int], *, wholly: bool = False) -> bool:
    """Whether the numbers of a row are a statistic of the rows above, as printed: most of them, or all."""
    right = numbers = 0
    for column, cell in enumerate(row):
        value = table.notation.number(cell) if cell else None
        if value is None or not math.isfinite(value):
            continue
        given = [table.notation.number(_cell(table.cells[i], column)) for i in above]
        known = np.array([v for v in given if v is not None and math.isfinite(v)])
        if known.size < min(2, len(above)) or not known.size:
            continue
        numbers += 1
        step = _step(cell, table.notation.decimal)
        right += any(abs(value - one) <= 0.51 * step + 1e-9 * abs(one) for one in _statistics(kind, known))
    return right > 0 and (right == numbers if wholly else 2 * right >= numbers)


def _step(cell: str, decimal: str) -> float:
    """The unit of the last digit of a number."""
    number, _, exponent = cell.lower().partition("e")
    return 10.0 ** (int(exponent or 0) - len(number.partition(decimal)[2]))


def _statistics(kind: str, v: FloatArray) -> list[float]:
    """Values that a statistic may have."""
    sd = float(v.std(ddof=1)) if v.size > 1 else math.nan
    mean = float(v.mean())
    with np.errstate(all="ignore"):
        relative = float(np.float64(sd) / mean)
    return {
        "mean": [mean],
        "sum": [float(v.sum())],
        "sd": [sd, float(v.std())],
        "variance": [sd**2, float(v.var())],
        "median": [float(np.median(v))],
        "rsd": [100 * relative, relative],
        "sem": [sd / math.sqrt(v.size)],
        "min": [float(v.min())],
        "max": [float(v.max())],
        "range": [float(np.ptp(v))],
        "count": [float(v.size)],
    }[kind]


def _cell(row: Sequence[str], column: int) -> str:
    return row[column] if column < len(row) else ""
