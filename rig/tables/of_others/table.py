"""A table of others as columns: of numbers, of text, with gaps."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Sequence
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING, Any

import numpy as np

from rig.errors import UsageError
from rig.procedures.tables.file_rows import rows_in_words
from rig.procedures.tables.table import Table
from rig.tables.of_others.cells import Cells
from rig.tables.of_others.numbers import is_missing
from rig.tables.of_others.where_the_table_is import NO_SEPARATOR

if TYPE_CHECKING:
    from rig.tables.of_others.cells import Cells

_SHOWN, _FEW, _LONG = 8, 3, 40
_SAID = {";": "semicolons", "\t": "tabs", "|": "pipes", " ": "blanks"}
_EPOCH = re.compile(r"time|epoch|stamp|zeit|^t\b|date", re.IGNORECASE)
_TICKS = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}
_SERIAL, _FROM_DAY, _TO_DAY = re.compile(r"excel|serial|ole|spreadsheet", re.IGNORECASE), 29221.0, 73051.0
"""Names of dates that count days from 1899-12-30, from 1980 to 2100."""
_FROM_S, _TO_S = 315532800.0, 4102444800.0
"""1980 and 2100, in seconds since 1970: such numbers, or 1e3, 1e6 and 1e9 times them, are times of day and year."""


def sentences(cells: Cells) -> Iterator[str]:
    """The sentences about a file, part by part."""
    yield from _marks(cells)
    yield from _heads(cells)
    yield from _columns(cells)
    if cells.remarks:
        yield f"{rows_in_words(cells.remarks)} left out as {'remarks' if len(cells.remarks) > 1 else 'a remark'}"
    if cells.footers:
        which = ", ".join(f"row {row} ({cell[:_LONG]})" for row, cell in list(cells.footers.items())[:_SHOWN])
        more = f" and {len(cells.footers) - _SHOWN} more" if len(cells.footers) > _SHOWN else ""
        yield f"{which}{more} left out: no observation"
    if cells.layout.after and cells.layout.pairs:
        yield f"{rows_in_words(cells.layout.after)} without such values not read"
    elif cells.layout.after:
        yield f"what follows the table from row {cells.layout.after[0]} on was not read"


def _marks(cells: Cells) -> Iterator[str]:
    """Separator, decimal sign, encoding."""
    layout, notation = cells.layout, cells.notation
    if layout.pairs:
        yield f"key=value: the name of each value stands beside it; the columns are {', '.join(cells.columns)}"
    elif layout.separator == NO_SEPARATOR:
        yield "one column"
    elif layout.separator != ",":
        yield f"cells separated by {_SAID[layout.separator]}"
    if cells.whole:
        yield "quotes around whole lines left out"
    if notation.decimal == ",":
        yield f"decimal comma{', ' * bool(notation.why)}{notation.why}"
    if notation.grouped:
        yield f"digits in groups, such as {notation.grouped}"
    if cells.encoding not in ("utf-8", "utf-8-sig"):
        yield f"encoding {cells.encoding}"


def _heads(cells: Cells) -> Iterator[str]:
    """Names, units, and other rows above the values."""
    layout = cells.layout
    if not layout.header and not layout.pairs:
        more = ", ..." if len(cells.columns) > _FEW else ""
        yield f"no names: the columns are {', '.join(list(cells.columns)[:_FEW])}{more}"
    elif layout.groups:
        yield f"names in row {layout.header}, with those of their groups in row {layout.groups} where they occur twice"
    elif layout.header > 1 or layout.before or (cells.empty and not layout.pairs):
        yield f"names in row {layout.header}"
    if layout.processing:
        they = "they say" if len(layout.processing) > 1 else "it says"
        yield f"{rows_in_words(layout.processing)} left out: {they} how the logger made the values"
    for name, number in layout.constants.items():
        yield f"{name} = {number} stands above the table and is not used"
    if layout.earlier:
        yield f"another table before it, up to row {layout.earlier}, was not read"
    if cells.units:
        where = f" (row {layout.units_row})" if layout.units_row else ""
        yield f"units{where} " + ", ".join(f"{name} {unit}" for name, unit in cells.units.items())
    elif layout.units_row:
        yield f"row {layout.units_row} left out: a row of units without any"
    if cells.in_cells:
        yield f"numbers with their unit in each cell: {', '.join(cells.in_cells)}"
    for name in cells.errors:
        own = f"u_{name}"
        yield (
            f"the digits in parentheses beside {name} are its standard uncertainty, in the column {own}"
            if own in cells.columns
            else f"what stands beside the values of {name} is not used: give standard uncertainties in a column {own}"
        )
    for name in cells.renamed:
        yield f"{name} names several columns, which are {name} (column N)"
    nameless = [name for name in cells.columns if name not in layout.names and name.startswith("column_")]
    if nameless and layout.header:
        yield f"without a name: {', '.join(nameless[:_SHOWN])}"


def _columns(cells: Cells) -> Iterator[str]:
    """Columns without values, times, and what instruments write in place of a reading."""
    if cells.empty:
        more = f" and {len(cells.empty) - _SHOWN} more" if len(cells.empty) > _SHOWN else ""
        yield f"no values in {', '.join(cells.empty[:_SHOWN])}{more}"
    for name, form in cells.times.items():
        if form:
            yield f"dates in {name}: {form}"
    for name, column in cells.columns.items():
        if epoch := _epoch(name, [cells.notation.number(cell) for cell in (column[0], column[-1])]):
            yield epoch
    overloaded = sum(count for cell, count in cells.no_readings.items() if cell.endswith("37"))
    if overloaded:
        yield f"{overloaded} cell{'s' * (overloaded > 1)} with 9.9E37, the overload of a meter: no value"
    for cell, count in cells.no_readings.items():
        if not cell.endswith("37"):
            yield f"{count} cell{'s' * (count > 1)} with {cell}: no reading, so no value"


def _epoch(name: str, ends: Sequence[float | None]) -> str:
    """A sentence about a column of numbers that count from 1970; "" for any other."""
    first, last = ends
    if first is None or last is None or not _EPOCH.search(name):
        return ""
    if _SERIAL.search(name) and _FROM_DAY <= first <= _TO_DAY and _FROM_DAY <= last <= _TO_DAY:
        start = (datetime(1899, 12, 30, tzinfo=UTC) + timedelta(days=first)).strftime("%Y-%m-%d %H:%M:%S")
        return f"{name} counts days as a spreadsheet does: the first row is of {start}"
    for tick, many in _TICKS.items():
        if _FROM_S <= first / many < _TO_S and _FROM_S <= last / many < _TO_S:
            start = datetime.fromtimestamp(first / many, UTC).strftime("%Y-%m-%d %H:%M:%S")
            return f"{name} counts {tick} from 1970 on, if it is the time: the first row is of {start} UTC"
    return ""


class TableOfOthers(Cells):
    """A table that another program wrote, read in one of three ways."""

    def any(self, needed: Collection[str]) -> Table:
        """All columns; rows without a value in a needed column are left out, and other columns with gaps.

        Raises:
            UsageError: a needed column is missing, or no row has all values.
        """
        self._check(needed)
        kept = np.ones(len(self.rows), bool)
        gaps: dict[str, list[int]] = {}
        for name in needed:
            missing = self.missing(name)
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
            missing = (self.missing(name) | self.endless(name)) & kept
            if name not in needed and missing.any():
                left[name] = self.rows[int(np.flatnonzero(missing)[0])]
                continue
            values = self.values(name, kept, self.missing(name))
            (columns if values.dtype.kind == "f" else text)[name] = values
        rows = [row for row, keep in zip(self.rows, kept, strict=True) if keep]
        return self._table(columns, text, rows, self._understood(gaps), left)

    def gappy(self, numbers: Collection[str] = ()) -> Table:
        """All columns and rows: NaN for a missing number, "" for missing text. Raises `UsageError`."""
        columns: dict[str, Any] = {}
        text: dict[str, Any] = {}
        every = np.ones(len(self.rows), bool)
        for name, cells in self.columns.items():
            missing = self.missing(name)
            if name not in numbers:
                missing |= self.endless(name)
            values = self.values(name, every, missing, numeric=name in numbers)
            if values.dtype.kind == "f":
                columns[name] = values
            else:
                text[name] = np.array(["" if gap else cell for cell, gap in zip(cells, missing, strict=True)])
        return self._table(columns, text, self.rows, self._understood({}))

    def strict(self) -> Table:
        """All columns as numbers without gaps. Raises `UsageError`."""
        columns: dict[str, Any] = {}
        for name, cells in self.columns.items():
            missing = self.missing(name) | np.array([is_missing(cell) for cell in cells])
            if missing.any():
                at = int(np.flatnonzero(missing)[0])
                where = f"{self.path}, row {self.rows[at]}, column {name}"
                stands = f" ({cells[at]} stands for none)" if cells[at] in self.words_for_none[name] else ""
                raise UsageError(f"{where}: the value is missing{stands}; fill it in or remove the row")
            columns[name] = self.values(name, np.ones(len(self.rows), bool), missing, numeric=True)
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
