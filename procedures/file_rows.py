"""Row numbers in messages are those of the file, whatever rows are used and in whatever order."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from fitter.arrays import IntArray
from fitter.formula import RowError
from procedures.table import Table


@contextmanager
def rows_of_file(table: Table, order: IntArray | None = None) -> Iterator[None]:
    """A context in which a `RowError` gets the row's number in the table's file.

    Args:
        table: source of the rows.
        order: (n,) observation of each row; None for the original order.
    """
    try:
        yield
    except RowError as error:
        raise error.at(table.row(error.index if order is None else int(order[error.index]))) from error
