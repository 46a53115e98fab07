"""Errors of recorded quantities as a register of equipment states them: corrections, uncertainties, behaviour."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from math import inf
from typing import Literal

import numpy as np

from rig.fitter.arrays import FloatArray

Behaviour = Literal["offset", "gain", "turn", "setting", "replication", "reading"]
Distribution = Literal["normal", "rectangular", "triangular", "arcsine"]
BEHAVIOURS: dict[Behaviour, str] = {
    "offset": "the same error in all readings, of a size that may vary over the quantity",
    "gain": "an error in proportion to the reading",
    "turn": "an error of an angle with one period per turn and unknown phase; its uncertainty is that at any angle",
    "setting": "an independent error at every setting, the same whenever the setting is taken again",
    "replication": "an independent error in every replication",
    "reading": "an independent error in every observation",
}
UNSTATED = "the register states no errors of {names}: none are in these uncertainties, which are too small"

Curve = Callable[[FloatArray], FloatArray]


@dataclass(frozen=True, eq=False)
class Computed:
    """A column that is computed from the readings of a meter.

    Attributes:
        reading: (n,) values of the column to (n,) readings, in the unit of a stated quantity.
        value: (n,) readings, in that unit, to (n,) values of the column.
    """

    reading: Curve
    value: Curve


@dataclass(frozen=True, eq=False)
class Stated:
    """One stated error of recorded columns.

    Attributes:
        name: for budgets: "DVM-0102 gain".
        source: asset and certificate.
        columns: recorded columns that have the error, with the number of their units in one of the quantity's.
        behaves: how it varies over observations.
        correction: (n,) values of the quantity to (n,) corrections, in the quantity's unit.
        standard: (n,) values of the quantity to (n,) standard uncertainties, in the quantity's unit.
        df: degrees of freedom.
        distribution: of the error.
        reads: whether it is a meter of sensors' outputs, which may be in use later too.
        covered: lowest and highest value of the quantity covered; None for any.
        key: place in the register's file, for messages.
        computed: those of the columns that are computed from the quantity, such as a factor from the reading of its
            reference standard. They are not outputs, whatever `reads` says.
    """

    name: str
    source: str
    columns: Mapping[str, float]
    behaves: Behaviour
    correction: Curve
    standard: Curve
    df: float = inf
    distribution: Distribution = "normal"
    reads: bool = False
    covered: tuple[float, float] | None = None
    key: str = ""
    computed: Mapping[str, Computed] = field(default_factory=dict)

    def quantity(self, column: str, values: FloatArray) -> FloatArray:
        """(n,) values of a column to (n,) values of the quantity."""
        found = self.computed.get(column)
        return values / self.columns[column] if found is None else found.reading(values)

    def moved(self, column: str, values: FloatArray, error: FloatArray) -> FloatArray:
        """(n,) changes of a column by (n,) errors of the quantity."""
        found = self.computed.get(column)
        if found is None:
            return np.asarray(self.columns[column] * error)
        reading = found.reading(values)
        return np.asarray(found.value(reading + error) - found.value(reading))


@dataclass(frozen=True)
class PlaceConstant:
    """A constant of the place: "gravity" (m/s2), "levelling" (deg), "line_head" (m).

    Attributes:
        name: its name.
        value: its value.
        standard: its standard uncertainty.
        df: degrees of freedom.
        distribution: of its error.
        source: where it is from.
    """

    name: str
    value: float
    standard: float
    df: float = inf
    distribution: Distribution = "normal"
    source: str = ""


@dataclass(frozen=True, eq=False)
class Statements:
    """All that a register states about the columns of a run.

    Attributes:
        errors: of recorded columns.
        place: constants of the place, by name.
        unused: parts of the register that belong to this bench and that nothing uses, with the reason.
        example: whether the values are examples.
        lacking: errors that are missing, though the bench has what makes them, a sentence each.
    """

    errors: Sequence[Stated] = ()
    place: Mapping[str, PlaceConstant] = field(default_factory=dict)
    unused: Sequence[str] = ()
    example: bool = False
    lacking: Sequence[str] = ()

    @property
    def constants(self) -> Mapping[str, float]:
        """Values of the constants of the place, by name."""
        return {name: one.value for name, one in self.place.items()}

    def unstated(self, columns: Iterable[str]) -> tuple[str, ...]:
        """Columns whose own errors the register does not state; those of a meter behind one are others."""
        known = {name for one in self.errors for name in one.columns if name not in one.computed}
        return tuple(name for name in columns if name not in known)

    def what_is_lacking(self, unstated: Sequence[str]) -> list[str]:
        """Sentences on errors that uncertainties lack, for the first lines of a result: of columns, of the register."""
        return [*([UNSTATED.format(names=", ".join(unstated))] if unstated else []), *self.lacking]
