"""A table: columns of numbers with units in their names, and where they came from."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fitter.arrays import IntArray

Columns = Mapping[str, np.ndarray[Any, np.dtype[np.float64]]]
SENSOR_TEMPERATURE = "sensor_temperature_degC"

UNITS = {
    "elapsed": "s",
    "pitch": "deg",
    "roll": "deg",
    "sensor_temperature": "degC",
    "sse_temperature": "degC",
    "pressure": "psia",
}
"""Quantities that have a column of their own in tables, and the unit they are in."""


@dataclass(frozen=True)
class Table:
    """Columns of numbers.

    Attributes:
        source: where it came from, for messages and reports.
        columns: name to values, all of one length.
        simulated: no real instrument involved, as far as is known.
        provenance: what is known of where the numbers come from, for reports and calibration files.
        axes: nominal axis of each output, where the source says so; elsewhere a name's first letter does.
        declared: the `[model]` of the procedure that made them, where there is one.
        text: columns that hold something else than numbers, for tables of any kind.
        gaps: columns that are not here because values are missing, and the first row of the file that lacks one.
        rows: number in the file of every row, the line of names being row 1; () where they follow it one by one.
        kind: of calibration, where the source says so.

    """

    source: str
    columns: Columns
    simulated: bool
    provenance: Mapping[str, Any]
    axes: Mapping[str, str] = field(default_factory=dict)
    declared: Mapping[str, Any] = field(default_factory=dict)
    text: Mapping[str, np.ndarray[Any, np.dtype[np.str_]]] = field(default_factory=dict)
    gaps: Mapping[str, int] = field(default_factory=dict)
    rows: Sequence[int] = ()
    kind: str = ""

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))

    @property
    def names(self) -> list[str]:
        """Of all columns of the file, as far as they are known."""
        return [*self.columns, *self.text, *self.gaps]

    def row(self, i: int) -> int:
        """Number in the file of observation `i`."""
        return self.rows[i] if self.rows else i + 2

    @property
    def numbers(self) -> IntArray:
        """(n,) `row` of every observation."""
        return np.array(self.rows, np.int64) if self.rows else np.arange(len(self)) + 2


Reader = Callable[[Collection[str]], Table]
"""Reads a table of which these columns are needed."""
