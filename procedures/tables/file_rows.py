"""Row numbers in messages are those of the file, whatever rows are used and in whatever order."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from rig.fitter.arrays import IntArray
from rig.fitter.formula import RowError
from rig.procedures.tables.table import Table

_SHOWN = 8


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


def rows_in_words(rows: Sequence[int]) -> str:
    """Numbers of rows in a sentence, the first eight of them."""
    more = f" and {len(rows) - _SHOWN} more" if len(rows) > _SHOWN else ""
    return f"row{'s' if len(rows) > 1 else ''} {', '.join(map(str, rows[:_SHOWN]))}{more}"
