"""Rows in messages are those of the file, whatever rows of it were used and in which order."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from fitter.arrays import IntArray
from fitter.formula import RowError
from procedures.table import Table


@contextmanager
def rows_of_file(table: Table, order: IntArray | None = None) -> Iterator[None]:
    """Inside, a `RowError` gets the number that the row has in the table's file.

    Args:
        table: where the rows come from.
        order: (n,) of which observation each row is; None for as they come.

    """
    try:
        yield
    except RowError as error:
        raise error.at(table.row(error.index if order is None else int(order[error.index]))) from error
