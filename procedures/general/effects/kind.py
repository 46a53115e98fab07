"""Kinds of effects in any table, and effects with their columns."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

from rig.fitter.effects.entry import Entry, Stratum
from rig.fitter.trace.engine.term import TableTerm
from rig.procedures.general.effects.quantities import Quantity, are_neighbours, is_quantity
from rig.procedures.general.effects.scene import TableScene

Of = Literal[
    "constant",
    "group",
    "group of variable",
    "pair of groups",
    "setting",
    "pair of settings",
    "covariate",
    "covariate of setting",
    "time",
    "clock",
    "setting by the clock",
    "clock of setting",
    "direction",
    "speed",
    "direction of setting",
    "direction by covariate",
    "bits",
    "bits of group",
]
"""Requirement of a kind of effect on a column, or a pair of columns."""


@dataclass(frozen=True)
class TableKind:
    """A kind of effect.

    Attributes:
        name: of the kind; an effect's name also has its columns.
        family: general word for reports: "nonlinearity", "periodic", "temperature", "drift", "group" and so on.
        of: its columns.
        cause: the physical mechanism, with {0} and {1} for the columns.
        stratum: stratum of its variation in a balanced order.
        unit: of the coefficients, {y} for the response and {0}, {1} for the columns.
        separate_by: the measurement that confirms it.
        usual_size: usual size for instruments.
        terms: its columns.
        warm: the kind's name if the column is a temperature.
        called: kinds in its place if the column is such a quantity: the same columns under the field's own name.
        dynamic: see `rig.fitter.effects.entry.Entry`.
        beside: the same for the output of a sensor beside that of the response.
    """

    name: str
    family: str
    of: Of
    cause: str
    stratum: Stratum
    unit: str
    separate_by: str
    usual_size: str
    terms: Callable[..., Sequence[TableTerm]]
    warm: str = ""
    called: Mapping[Quantity, TableKind] = field(default_factory=dict)
    dynamic: bool = False
    beside: TableKind | None = None

    def of_columns(self, names: Sequence[str], response: str) -> TableKind:
        """The kind for certain columns and a response."""
        if self.beside is not None and are_neighbours(names[0], response):
            return self.beside
        return next((kind for quantity, kind in self.called.items() if is_quantity(names[0], quantity)), self)


@dataclass(frozen=True)
class TableEffect(Entry):
    """A kind of effect in certain columns.

    Attributes:
        kind: of effect.
        columns: its columns.
        family: general word for reports.
    """

    kind: TableKind
    columns: tuple[str, ...]
    family: str

    def terms(self, scene: TableScene) -> Sequence[TableTerm]:
        """Its blocks of columns, one for each value of a searched constant."""
        return self.kind.terms(scene, *self.columns)
