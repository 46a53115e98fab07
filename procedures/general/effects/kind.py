"""What a kind of effect in a table of any kind is, and what it is once it has columns."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

from fitter.effects.entry import Entry, Stratum
from procedures.general.effects.scene import TableScene, TableTerm

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
"""What a kind of effect needs a column, or a pair of columns, of."""


@dataclass(frozen=True)
class TableKind:
    """A kind of effect.

    Attributes:
        name: of the kind; an effect's name adds its columns.
        family: coarser word for reports: "nonlinearity", "periodic", "temperature", "drift", "group" and so on.
        of: what columns it is looked for in.
        cause: what happens physically, {0} and {1} for the columns.
        stratum: where it varies in a balanced order.
        unit: of the coefficients, {y} for the response and {0}, {1} for the columns.
        separate_by: the measurement that confirms it.
        usual_size: what instruments show.
        terms: its columns.
        warm: the same kind's name where the column is a temperature.

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


@dataclass(frozen=True)
class TableEffect(Entry):
    """A kind of effect in certain columns.

    Attributes:
        kind: of effect.
        columns: that it is looked for in.
        family: coarser word for reports.

    """

    kind: TableKind
    columns: tuple[str, ...]
    family: str

    def terms(self, scene: TableScene) -> Sequence[TableTerm]:
        """Its blocks of columns, one for each value of a constant that is searched."""
        return self.kind.terms(scene, *self.columns)
