"""A table of others as columns: of numbers, of text, with gaps."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from rig.errors import UsageError
from rig.procedures.tables.file_rows import rows_in_words
from rig.procedures.tables.table import Table
from rig.tables.of_others.asked import Asked
from rig.tables.of_others.encoding import text_of
from rig.tables.of_others.footers import footers, labelled_rows
from rig.tables.of_others.layout import NO_SEPARATOR, Layout, NoTable, is_time, layout_of
from rig.tables.of_others.lines import lines_of, quoted_whole
from rig.tables.of_others.numbers import (
    Notation,
    gaps_of,
    is_missing,
    is_no_reading,
    is_overload,
    looks_like_number,
    maybe_gap,
    notation_of,
)
from rig.tables.of_others.said import dates_with_dots, sentences, times_of, without_units


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

    @classmethod
    def read(cls, path: Path, data: bytes, asked: Asked) -> Cells:
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
        in_cells = tuple(name for name, i in zip(names, kept, strict=True) if i in inside)
        return cls(path, encoding, layout, notation, columns, units, renamed, remarks, left, in_cells, bool(whole))

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
            words = self._words[name]
            for cell, count in Counter(cells).items():
                if cell in words or is_overload(cell):
                    found[cell] = found.get(cell, 0) + count
        return found

    @cached_property
    def _words(self) -> dict[str, frozenset[str]]:
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
        gaps = gaps_of(np.array([np.nan if value is None else value for value in self._read[name]], np.float64))
        return frozenset(cell for cell in maybe if self.notation.number(cell) in gaps)

    @cached_property
    def _read(self) -> dict[str, list[float | None]]:
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
        ordinary = ordinary and not self.no_readings and not self.empty and not self.in_cells and not self.whole
        return ordinary and self.layout.header == 1 and self.notation == Notation()

    def any(self, needed: Collection[str]) -> Table:
        """All columns; rows without a value in a needed column are left out, and other columns with gaps.

        Raises:
            UsageError: a needed column is missing, or no row has all values.
        """
        self._check(needed)
        kept = np.ones(len(self.rows), bool)
        gaps: dict[str, list[int]] = {}
        for name in needed:
            missing = self._missing(name)
            if missing.any():
                gaps[name] = [self.rows[i] for i in np.flatnonzero(missing)]
                kept &= ~missing
        if not kept.any():
            names = " and ".join(gaps)
            raise UsageError(f"{self.path}: no row has a value in {names}; choose columns that have values")
        columns: dict[str, Any] = {}
        text: dict[str, Any] = {}
        left: dict[str, int] = {}
        for name in self.columns:
            missing = (self._missing(name) | self._endless(name)) & kept
            if name not in needed and missing.any():
                left[name] = self.rows[int(np.flatnonzero(missing)[0])]
                continue
            values = self._values(name, kept, self._missing(name))
            (columns if values.dtype.kind == "f" else text)[name] = values
        rows = [row for row, keep in zip(self.rows, kept, strict=True) if keep]
        return self._table(columns, text, rows, self._understood(gaps), left)

    def gappy(self, numbers: Collection[str] = ()) -> Table:
        """All columns and rows: NaN for a missing number, "" for missing text. Raises `UsageError`."""
        columns: dict[str, Any] = {}
        text: dict[str, Any] = {}
        every = np.ones(len(self.rows), bool)
        for name, cells in self.columns.items():
            missing = self._missing(name)
            if name not in numbers:
                missing |= self._endless(name)
            values = self._values(name, every, missing, numeric=name in numbers)
            if values.dtype.kind == "f":
                columns[name] = values
            else:
                text[name] = np.array(["" if gap else cell for cell, gap in zip(cells, missing, strict=True)])
        return self._table(columns, text, self.rows, self._understood({}))

    def strict(self) -> Table:
        """All columns as numbers without gaps. Raises `UsageError`."""
        columns: dict[str, Any] = {}
        for name, cells in self.columns.items():
            missing = self._missing(name) | np.array([is_missing(cell) for cell in cells])
            if missing.any():
                at = int(np.flatnonzero(missing)[0])
                where = f"{self.path}, row {self.rows[at]}, column {name}"
                stands = f" ({cells[at]} stands for none)" if cells[at] in self._words[name] else ""
                raise UsageError(f"{where}: the value is missing{stands}; fill it in or remove the row")
            columns[name] = self._values(name, np.ones(len(self.rows), bool), missing, numeric=True)
        return self._table(columns, {}, self.rows, self._understood({}))

    def _table(
        self,
        columns: dict[str, Any],
        text: dict[str, Any],
        rows: Sequence[int],
        understood: dict[str, Any],
        gaps: dict[str, int] | None = None,
    ) -> Table:
        simulated = bool(np.any(columns.get("simulated", 0.0)))
        provenance = {"file": self.path.name, "simulated": simulated}
        return Table(
            str(self.path), columns, simulated, provenance, text=text, gaps=gaps or {}, rows=rows, units=self.units,
            understood=understood,
        )  # fmt: skip

    def _check(self, needed: Collection[str]) -> None:
        for name in needed:
            if name in self.columns:
                continue
            if name in self.renamed:
                several = [one for one in self.columns if one.startswith(f"{name} (column ")]
                raise UsageError(f"{self.path}: {name!r} is the name of several columns: say {' or '.join(several)}")
            raise UsageError(f"{self.path}: there is no column {name!r}; it has {', '.join(self.columns)}")

    def _missing(self, name: str) -> np.ndarray[Any, np.dtype[np.bool_]]:
        """(n,) whether a cell has no value; "-" beside "+" is a direction."""
        cells = self.columns[name]
        signs = {cell for cell in cells if cell} <= {"+", "-"} and "+" in cells
        gaps = {one for one in set(cells) if one == "" or (is_missing(one) and not signs) or one in self._words[name]}
        return np.array([cell in gaps for cell in cells])

    def _endless(self, name: str) -> np.ndarray[Any, np.dtype[np.bool_]]:
        """(n,) whether a cell is an infinite number."""
        return np.array([value in (np.inf, -np.inf) for value in self._read[name]])

    def _values(
        self, name: str, kept: np.ndarray[Any, Any], missing: np.ndarray[Any, Any], *, numeric: bool = False
    ) -> np.ndarray[Any, Any]:
        """(n kept,) values of a column: numbers, with NaN for missing ones, if all are or must be; otherwise text."""
        cells = self.columns[name]
        values = [None if gap else value for value, gap in zip(self._read[name], missing.tolist(), strict=True)]
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

    def _understood(self, gaps: dict[str, list[int]]) -> dict[str, Any]:
        """How the table was read, as JSON values with a sentence; {} for a table like our own."""
        said = list(sentences(self))
        for name, rows in gaps.items():
            many = "rows" if len(rows) > 1 else "row"
            said.append(f"{len(rows)} {many} left out without a value in {name} ({rows_in_words(rows)})")
        if self.layout.header and self.layout.before:
            said.append(f"{self.layout.before} line{'s' * (self.layout.before > 1)} above the names not read")
        if not said:
            return {}
        return {
            "sentence": f"{self.path.name} was read as follows: {'; '.join(said)}",
            "encoding": self.encoding,
            "separator": self.layout.separator,
            "decimal": self.notation.decimal,
            "header_row": self.layout.header,
            "units": self.units,
            "times": {name: form for name, form in self.times.items() if form},
            "rows_of_processing": list(self.layout.processing),
            "constants": dict(self.layout.constants),
            "rows_without_value": gaps,
            "rows_of_remarks": list(self.remarks),
            "rows_after": list(self.layout.after),
            "rows_of_summaries": self.footers,
        }


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
