"""A table of others as columns: of numbers, of text, with gaps."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

import numpy as np

from rig.errors import UsageError
from rig.procedures.tables.file_rows import rows_in_words
from rig.procedures.tables.table import Table
from rig.tables.of_others.cells import Cells
from rig.tables.of_others.numbers import is_missing
from rig.tables.of_others.said import sentences


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
