"""A table with what was inferred from it.

Of rows that lack a value the result is empty, with the reason in the flag; the others are inferred.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from rig.procedures.errors import DataError
from rig.procedures.tables.unused import Unused, other_unit, why_unused

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rig.fitter.arrays import FloatArray
    from rig.procedures.tables.table import Table

INFERRED = "inferred_"
"""Before the name of a quantity that the table has already."""


@dataclass(frozen=True)
class Inference:
    """A table with inferred quantities.

    Attributes:
        columns: the input's, and the added ones.
        added: names of the added ones.
        notes: notes for readers.
        flagged: number of rows with a flag.
        quantities: names of the inferred quantities; each has columns with _sd, _lo95 and _hi95 after its name.
        unused: unused columns and rows.
        zeros: pressure: the used zero, by output, as JSON values.
        df: (n,) degrees of freedom of the standard deviation of each quantity; NaN where it has none.
        alike: quantities that are one and the same by several sensors, such as `prt_1_bath_degC`: the sensor of each.
        turns: a full turn, in the unit of the quantity, of those that begin again after it, such as angles: 360.
        flags: the column of flags of each quantity, where there are several such columns.
        outputs: outputs from which each quantity is inferred.
        stated: quantities for which the error of a reading in use is stated.
        uncertainty: what standard deviations and intervals have: "total", or that they are repeatability only.
        readings: for how many readings in use each quantity's uncertainty holds, or words where that is no number.
        own_sd: (n,) standard deviation of each quantity without the influences below; {} if there are none.
        shifts: (m, n) change of each quantity by one standard uncertainty of each of m influences, the same in all.
        shifts_df: (m,) degrees of freedom of these.
    """

    columns: Mapping[str, Any]
    added: tuple[str, ...]
    notes: tuple[str, ...]
    flagged: int
    quantities: tuple[str, ...] = ()
    unused: Unused = field(default_factory=Unused)
    zeros: Mapping[str, Any] = field(default_factory=dict)
    df: Mapping[str, FloatArray] = field(default_factory=dict)
    alike: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    turns: Mapping[str, float] = field(default_factory=dict)
    flags: Mapping[str, str] = field(default_factory=dict)
    outputs: Mapping[str, Sequence[str]] = field(default_factory=dict)
    stated: frozenset[str] = frozenset()
    uncertainty: str = ""
    readings: Mapping[str, Any] = field(default_factory=dict)
    own_sd: Mapping[str, FloatArray] = field(default_factory=dict)
    shifts: Mapping[str, FloatArray] = field(default_factory=dict)
    shifts_df: Sequence[float] = ()

    def flag_of(self, quantity: str) -> str | None:
        """The column of reasons why a quantity's values have none or are doubtful; None if it has no such column."""
        alone = [name for name in self.added if name.endswith("flag")]
        return self.flags.get(quantity, alone[0] if len(alone) == 1 else None)

    def to_json(self) -> dict[str, Any]:
        """JSON values for `rig infer --json`; the numbers are in the CSV."""
        return {
            "rows": len(next(iter(self.columns.values()))),
            "flagged": self.flagged,
            "quantities": list(self.quantities),
            "added": list(self.added),
            "uncertainty": self.uncertainty,
            "mean_of_readings": dict(self.readings),
            "notes": list(self.notes),
            "unused": self.unused.to_json(),
            "zeros": dict(self.zeros),
        }


def within_half_turn(apart: FloatArray, turn: float) -> FloatArray:
    """Differences of angles, of any shape, on the short way round: -turn/2 to turn/2, in the unit of `turn`."""
    return np.asarray(apart - turn * np.round(apart / turn))


def empty_rows(inputs: Mapping[str, FloatArray]) -> NDArray[Any]:
    """(n,) missing values of a row, in words; empty for a complete row."""
    lacks = {name: ~np.isfinite(values) for name, values in inputs.items()}
    flag = np.full(len(next(iter(inputs.values()))), "", dtype=object)
    for i in np.flatnonzero(np.any(list(lacks.values()), axis=0)):
        flag[i] = f"no value of {', '.join(name for name, gaps in lacks.items() if gaps[i])}"
    return flag


def incomplete_rows(table: Table, inputs: Mapping[str, FloatArray]) -> list[tuple[int, str]]:
    """(row in the file, column) of every missing value."""
    return [(table.row(int(i)), name) for name, values in inputs.items() for i in np.flatnonzero(~np.isfinite(values))]


def empty_results(gaps: Iterable[tuple[int, str]]) -> list[tuple[int | None, str, str]]:
    """Rows that `incomplete_rows` gives, with what becomes of them."""
    return [(row, name, "no value: the result of the row is empty") for row, name in gaps]


def unused_beside(table: Table, needed: Collection[str], inputs: Mapping[str, FloatArray]) -> Unused:
    """Columns that are not needed, and rows that lack one of the `inputs`."""
    spare = {name: why_unused(name, needed) for name in table.names if name not in {*needed, "simulated"}}
    return Unused(spare, empty_results(incomplete_rows(table, inputs)))


def no_column(table: Table, name: str, more: str = "") -> DataError:
    """That a column is missing; where the table has it in another unit, what to do."""
    like = next((other for other in table.names if other_unit(other, [name])), None)
    hint = f"; {like}: {why_unused(like, [name])}" if like else ""
    return DataError(f"{table.source}: there is no column {name!r}; it has {', '.join(table.names)}{hint}{more}")


def free_name(name: str, table: Table) -> str:
    """A name for a column that is added: nothing of the input is overwritten."""
    return f"{INFERRED}{name}" if name in table.columns or name in table.text else name
