"""The cells of a table of others, as they stand in its file."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np

from rig.errors import UsageError
from rig.procedures.tables.dates import Stamp, form_of, stamp_of
from rig.tables.of_others.cells_of_lines import lines_of, quoted_whole
from rig.tables.of_others.encoding import text_of
from rig.tables.of_others.file_form import FileForm
from rig.tables.of_others.footers import footers, labelled_rows
from rig.tables.of_others.numbers import (
    Notation,
    gaps_of,
    is_missing,
    is_no_reading,
    is_overload,
    looks_like_number,
    maybe_gap,
    notation_of,
    without_errors,
    without_units,
)
from rig.tables.of_others.where_the_table_is import NO_SEPARATOR, Layout, NoTable, is_time, layout_of

_FIRST = 50
"""Cells of a column by which its dates are recognised."""


def times_of(columns: Mapping[str, Sequence[str]]) -> dict[str, str]:
    """How the dates of columns are read, in words, by column; "" where they leave no doubt."""
    found = {}
    for name, cells in columns.items():
        stamps = _stamps(cells)
        if stamps:
            found[name] = form_of(stamps)
    return found


def dates_with_dots(cells: Sequence[str]) -> bool:
    """Whether a column has dates with dots between their numbers, as 24.11.2020."""
    return any(stamp.numbers and stamp.sign == "." for stamp in _stamps(cells[:_FIRST]))


def _stamps(cells: Sequence[str]) -> list[Stamp]:
    """The times of a column; [] if it has anything else."""
    found = []
    for cell in cells:
        if is_missing(cell):
            continue
        if (stamp := stamp_of(cell)) is None:
            return []
        found.append(stamp)
    return found


@dataclass(frozen=True)
class Cells:
    """A table, with its cells as text.

    Attributes:
        path: the file.
        encoding: of its text.
        layout: the place of the table.
        notation: of its numbers.
        columns: cells by column name.
        units: by column name, from a row of units.
        renamed: names that occurred twice.
        remarks: rows of remarks among the values.
        footers: rows of the file that are no observations, with the cell that shows it.
        in_cells: columns that have a unit in each cell.
        whole: whether quotes stand around whole lines.
        errors: columns that had an uncertainty beside each value.
    """

    path: Path
    encoding: str
    layout: Layout
    notation: Notation
    columns: dict[str, list[str]]
    units: dict[str, str]
    renamed: tuple[str, ...]
    remarks: tuple[int, ...]
    footers: dict[int, str]
    in_cells: tuple[str, ...] = ()
    whole: bool = False
    errors: tuple[str, ...] = ()

    @classmethod
    def read(cls, path: Path, data: bytes, asked: FileForm) -> Self:
        """The table in the bytes of a file. Raises `UsageError`."""
        text, encoding = text_of(data, str(path), asked.encoding)
        lines = list(lines_of(text))
        whole = quoted_whole(lines)
        lines = whole or lines
        layout = layout_of(lines, str(path), asked)
        rows = [line.cells(layout.separator) for line in layout.body]
        if len(layout.names) < 2 and layout.separator != NO_SEPARATOR:
            raise NoTable(f"{path} holds no table that is recognised")
        for line, row in zip(layout.body, rows, strict=True):
            if any(row[len(layout.names) :]):
                raise UsageError(
                    f"{path}, row {line.row}: {len(row)} values for {len(layout.names)} columns; correct the row"
                )
        rows, stated = without_errors(rows, len(layout.names))
        layout, rows = _with_columns(layout, rows, stated)
        rows, inside = without_units(rows, len(layout.names))
        notation, footing = _notation(path, layout, rows, asked.decimal)
        left = {layout.body[i].row: cell for i, cell in footing.items()}
        if footing:
            rows = [row for i, row in enumerate(rows) if i not in footing]
            layout = replace(layout, body=[line for line in layout.body if line.row not in left])
        left = dict(sorted({**left, **dict.fromkeys(layout.again, "the names again")}.items()))
        if not rows:
            raise NoTable(f"{path} has column names and no rows")
        count = len(layout.names)
        each = [[row[i] if i < len(row) else "" for row in rows] for i in range(count)]
        kept = [i for i in range(count) if layout.names[i] or any(each[i])]
        names, renamed = _named([layout.names[i] for i in kept], kept)
        columns = {name: each[i] for name, i in zip(names, kept, strict=True)}
        units = {name: layout.units[i] for name, i in zip(names, kept, strict=True) if layout.units and layout.units[i]}
        units |= {name: inside[i] for name, i in zip(names, kept, strict=True) if i in inside}
        first = layout.body[0].row
        remarks = tuple(line.row for line in lines if line.remark and line.row > first)
        in_cells, errors = (tuple(n for n, i in zip(names, kept, strict=True) if i in own) for own in (inside, stated))
        return cls(
            path, encoding, layout, notation, columns, units, renamed, remarks, left, in_cells, bool(whole), errors
        )

    @cached_property
    def rows(self) -> list[int]:
        """Number in the file of every row."""
        return [line.row for line in self.layout.body]

    @cached_property
    def empty(self) -> tuple[str, ...]:
        """Columns without any value."""
        return tuple(name for name, cells in self.columns.items() if not any(cells))

    @cached_property
    def no_readings(self) -> dict[str, int]:
        """Number of cells with each word that stands in a column of numbers for no reading."""
        found: dict[str, int] = {}
        for name, cells in self.columns.items():
            words = self.words_for_none[name]
            for cell, count in Counter(cells).items():
                if cell in words or is_overload(cell):
                    found[cell] = found.get(cell, 0) + count
        return found

    @cached_property
    def words_for_none(self) -> dict[str, frozenset[str]]:
        """Words for no reading in each column: only where all other cells are numbers."""
        found = {}
        for name, cells in self.columns.items():
            words = frozenset(cell for cell in set(cells) if is_no_reading(cell))
            others = [cell for cell in cells if cell not in words and not is_missing(cell)] if words else []
            numbers = bool(others) and all(self.notation.number(cell) is not None for cell in others)
            found[name] = (words if numbers else frozenset()) | self._gaps(name)
        return found

    def _gaps(self, name: str) -> frozenset[str]:
        """Numbers of a column that stand for no value, as they are written."""
        cells = self.columns[name]
        if not (maybe := {cell for cell in set(cells) if maybe_gap(cell) and not is_missing(cell)}):
            return frozenset()
        gaps = gaps_of(np.array([np.nan if value is None else value for value in self.as_numbers[name]], np.float64))
        return frozenset(cell for cell in maybe if self.notation.number(cell) in gaps)

    @cached_property
    def as_numbers(self) -> dict[str, list[float | None]]:
        """The cells of each column as numbers, None for a cell that is none."""
        return {name: list(map(self.notation.number, cells)) for name, cells in self.columns.items()}

    @cached_property
    def times(self) -> dict[str, str]:
        """How the dates of columns of times are read, in words; "" where they leave no doubt."""
        return times_of(self.columns)

    @property
    def plain(self) -> bool:
        """Whether the file is written as our own tables are."""
        ordinary = self.encoding in ("utf-8", "utf-8-sig") and self.layout.separator == "," and not self.layout.units
        ordinary = ordinary and not self.footers and all(self.layout.names)
        ordinary = (
            ordinary
            and not self.no_readings
            and not self.empty
            and not self.in_cells
            and not self.whole
            and not self.errors
        )
        return ordinary and not self.whole and self.layout.header == 1 and self.notation == Notation()

    def missing(self, name: str) -> np.ndarray[Any, np.dtype[np.bool_]]:
        """(n,) whether a cell has no value; "-" beside "+" is a direction."""
        cells = self.columns[name]
        signs = {cell for cell in cells if cell} <= {"+", "-"} and "+" in cells
        gaps = {
            one
            for one in set(cells)
            if one == "" or (is_missing(one) and not signs) or one in self.words_for_none[name]
        }
        return np.array([cell in gaps for cell in cells])

    def endless(self, name: str) -> np.ndarray[Any, np.dtype[np.bool_]]:
        """(n,) whether a cell is an infinite number."""
        return np.array([value in (np.inf, -np.inf) for value in self.as_numbers[name]])

    def values(
        self, name: str, kept: np.ndarray[Any, Any], missing: np.ndarray[Any, Any], *, numeric: bool = False
    ) -> np.ndarray[Any, Any]:
        """(n kept,) values of a column: numbers, with NaN for missing ones, if all are or must be; otherwise text."""
        cells = self.columns[name]
        values = [None if gap else value for value, gap in zip(self.as_numbers[name], missing.tolist(), strict=True)]
        bad = [i for i, value in enumerate(values) if value is None and not missing[i]]
        if bad and numeric:
            where = f"{self.path}, row {self.rows[bad[0]]}, column {name}"
            raise UsageError(f"{where}: {cells[bad[0]][:40]!r} is not a number")
        if bad or (missing.all() and not numeric):
            return np.asarray(np.array(cells)[kept])
        for i, value in enumerate(values):
            if value is not None and not math.isfinite(value):
                where = f"{self.path}, row {self.rows[i]}, column {name}"
                raise UsageError(
                    f"{where}: {cells[i][:40]} is not a finite number; remove the row if there was no reading"
                )
        return np.asarray(np.array([np.nan if value is None else value for value in values])[kept])


def _with_columns(
    layout: Layout, rows: list[list[str]], stated: Mapping[int, Sequence[str]]
) -> tuple[Layout, list[list[str]]]:
    """A table with a column u_NAME for each that has standard uncertainties in its cells."""
    count, new = len(layout.names), {i: cells for i, cells in stated.items() if all(cells) and layout.names[i]}
    new = {i: cells for i, cells in new.items() if f"u_{layout.names[i]}" not in layout.names}
    if not new:
        return layout, rows
    names = (*layout.names, *(f"u_{layout.names[i]}" for i in new))
    rows = [[*row, *[""] * (count - len(row)), *(own[k] for own in new.values())] for k, row in enumerate(rows)]
    return replace(layout, names=names, units=(*layout.units, *[""] * len(new)) if layout.units else ()), rows


def _named(names: Sequence[str], places: Sequence[int]) -> tuple[list[str], tuple[str, ...]]:
    """Names of columns, each once, and the names that occurred twice."""
    tidy = [re.sub(r"\s+", " ", name).strip() for name in names]
    twice = tuple(dict.fromkeys(name for name in tidy if name and tidy.count(name) > 1))
    found: list[str] = []
    for name, place in zip(tidy, places, strict=True):
        new = name if name and name not in twice else f"{name} (column {place + 1})" if name else f"column_{place + 1}"
        while new in found:
            new += "'"
        found.append(new)
    return found, twice


def _notation(path: Path, layout: Layout, rows: Sequence[Sequence[str]], asked: str) -> tuple[Notation, dict[int, str]]:
    """The notation of the numbers, and the rows that are no observations, by index."""
    named = labelled_rows(rows)
    kept = [i for i in range(len(rows)) if i not in named] or list(range(len(rows)))
    columns = [[rows[i][column] if column < len(rows[i]) else "" for i in kept] for column in range(len(layout.names))]
    dotted = any(map(dates_with_dots, columns))
    numbers = _numbers(columns, [layout.body[i].row for i in kept])
    notation = notation_of(numbers, layout.separator, str(path), asked, dotted=dotted)
    apart = [line.apart for line in layout.body]
    return notation, footers(layout.names, rows, apart, notation, lambda i: f"{path}, row {layout.body[i].row}")


def _numbers(columns: Sequence[Sequence[str]], rows: Sequence[int]) -> Iterator[tuple[int, str]]:
    """Row and cell of every different cell in columns of numbers."""
    for cells in columns:
        given = [cell for cell in cells if not is_missing(cell)]
        if not given or sum(map(looks_like_number, given)) < 0.5 * len(given) or all(map(is_time, given)):
            continue
        first = dict(zip(reversed(cells), reversed(rows), strict=True))
        yield from ((first[cell], cell) for cell in dict.fromkeys(given))
