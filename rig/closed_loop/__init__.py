"""From a table to what it says: fit and trace, by the kind that the table is of."""

from __future__ import annotations

from typing import Any

from procedures.kind import Kind, kind_of_table, kinds
from procedures.results import Fitted, Traced
from procedures.table import Reader, Table
from rig.effects import laboratory_effects
from rig.errors import UsageError

__all__ = ["Fitted", "Traced", "fit_table", "trace_table"]


class _Given:
    """A table that was read already."""

    def __init__(self, table: Table) -> None:
        self.table = table
        self.name = table.source

    @property
    def read(self) -> Reader:
        """The table as it is."""
        return lambda needed: self.table


def fit_table(table: Table, **options: Any) -> Fitted:
    """Fit the declared model to every sensor of a table; `options` are those of its kind.

    Raises:
        UsageError: the table is of no kind that is known.
        procedures.errors.DataError: it lacks something, or its rows do not determine the model.

    """
    kind = known(table)
    asked = kind.fit_options(**options)
    return kind.fit(_Given(table), asked, leave_out=(), own=laboratory_effects(), keep=True)


def trace_table(table: Table, **options: Any) -> Traced:
    """Trace what the declared model lacks in every sensor of a table; arguments and errors as for `fit_table`."""
    kind = known(table)
    return kind.trace(_Given(table), kind.trace_options(**options), own=laboratory_effects())


def known(table: Table) -> Kind:
    """The kind of a table. Raises `UsageError` where none knows it."""
    kind = kind_of_table(table)
    if kind is None:
        tables = "; ".join(one.described for one in kinds().values())
        raise UsageError(f"{table.source} is no calibration that is known: {tables}")
    return kind
