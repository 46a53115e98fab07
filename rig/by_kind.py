"""Fit and trace of tables, by their kind of calibration."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rig.effects import laboratory_effects
from rig.errors import UsageError
from rig.procedures.evaluate.results import Fitted, Traced
from rig.procedures.kinds import kind_of_table, kinds

if TYPE_CHECKING:
    from rig.procedures.kind import Kind
    from rig.procedures.tables.table import Reader, Table

__all__ = ["Fitted", "Traced", "fit_table", "trace_table"]


class _Given:
    """A table that has been read."""

    def __init__(self, table: Table) -> None:
        self.table = table
        self.name = table.source

    @property
    def is_run(self) -> bool:
        """Whether it has outputs of a bench."""
        return bool(self.table.outputs)

    @property
    def read(self) -> Reader:
        """The table as it is."""
        return lambda needed: self.table


def fit_table(table: Table, **options: Any) -> Fitted:
    """Fit the declared model to every sensor of a table; `options` are those of its kind.

    Raises:
        UsageError: no kind matches the table.
        rig.procedures.errors.DataError: columns or values are missing, or the rows do not determine the model.
    """
    kind = known(table)
    asked = kind.fit_options(**options)
    return kind.fit(_Given(table), asked, leave_out=(), own=laboratory_effects(), keep=True)


def trace_table(table: Table, **options: Any) -> Traced:
    """Find effects missing in the declared model of every sensor of a table; arguments and errors as for
    `fit_table`.
    """
    kind = known(table)
    return kind.trace(_Given(table), kind.trace_options(**options), own=laboratory_effects())


def known(table: Table) -> Kind:
    """The kind of a table. Raises `UsageError` if no kind matches it."""
    kind = kind_of_table(table)
    if kind is None:
        tables = "; ".join(one.described for one in kinds().values())
        raise UsageError(f"{table.source} is not a table of a known kind of calibration: {tables}")
    return kind
