"""A table: columns of numbers with units in their names, and their source."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rig.fitter.arrays import IntArray
from rig.procedures.plan.hand_steps import Made
from rig.procedures.tables.moving import Moving
from rig.procedures.tables.within import Within

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
"""Quantities with their own column in tables, and their unit."""
CORRECTED = "typed entries corrected"
"""Key of a table's provenance: sentences, one for each correction of an entry that a person typed."""


@dataclass(frozen=True)
class Table:
    """Columns of numbers.

    Attributes:
        source: its source, for messages and reports.
        columns: name to values, all of one length.
        simulated: whether no real instrument was involved, if known.
        provenance: provenance of the numbers, for reports and calibration files.
        axes: nominal axis of each output, if the source gives it; otherwise it is a name's first letter.
        declared: the `[model]` of the procedure, if any.
        text: columns of text, for tables of any kind.
        gaps: columns left out because of missing values, with the first such row of the file.
        rows: number in the file of every row, where the header is row 1; () if they follow it without gaps.
        kind: of calibration, if the source gives it.
        by_hand: changes that a person made between the rows, or before the first, in order. Every one of them begins a
            new number in the column `block`, as an interruption does.
        units: of columns, where the source gives them in a row of units.
        outputs: columns of the sensors' outputs, and the sensors' names on the bench, if the source gives them.
        factors: columns of the factors of a run; of what was set in another unit, what its standard read.
        set_in: columns with the settings of such factors, by the factor.
        understood: how a table of others was read, as JSON values with "sentence"; {} for our own tables.
        within: the readings of which rows are means, by column, if they were recorded.
        moving: what had not settled when it was read, by column.
        readers: what reads an output or the standard of a factor, by column, as far as the bench of a run says it.
        sources: what sets a factor, by its column.
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
    by_hand: tuple[Made, ...] = ()
    units: Mapping[str, str] = field(default_factory=dict)
    understood: Mapping[str, Any] = field(default_factory=dict)
    outputs: Mapping[str, str] = field(default_factory=dict)
    factors: tuple[str, ...] = ()
    set_in: Mapping[str, str] = field(default_factory=dict)
    within: Mapping[str, Within] = field(default_factory=dict)
    moving: Mapping[str, Moving] = field(default_factory=dict)
    readers: Mapping[str, str] = field(default_factory=dict)
    sources: Mapping[str, str] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(next(iter({**self.text, **self.columns}.values()), ()))

    @property
    def names(self) -> list[str]:
        """Names of all columns of the file, if known."""
        return [*self.columns, *self.text, *self.gaps]

    def row(self, i: int) -> int:
        """Number in the file of observation `i`."""
        return self.rows[i] if self.rows else i + 2

    @property
    def numbers(self) -> IntArray:
        """(n,) `row` of every observation."""
        return np.array(self.rows, np.int64) if self.rows else np.arange(len(self)) + 2


Reader = Callable[[Collection[str]], Table]
"""Reads a table with these required columns."""
