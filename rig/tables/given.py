"""Tables passed in Python: columns by name, or a data frame."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from rig.errors import UsageError
from rig.procedures.tables.table import Table

if TYPE_CHECKING:
    from numpy.typing import ArrayLike
    from pandas import DataFrame

    Columns = Mapping[str, ArrayLike] | DataFrame
    """(n,) values by column name; missing values are NaN, None or pandas' own."""

SOURCE = "the given table"


def table_given(columns: Columns) -> Table:
    """A table of columns of numbers or of text. Missing values: NaN in a column of numbers, "" in one of text.

    Raises:
        UsageError: there are no columns or no rows, a column has another length, or a value cannot be used.
    """
    numbers: dict[str, np.ndarray[Any, np.dtype[np.float64]]] = {}
    text: dict[str, np.ndarray[Any, np.dtype[np.str_]]] = {}
    rows: int | None = None
    for name, given in columns.items():
        if not isinstance(name, str):
            raise UsageError(f"{SOURCE}: a column is called {name!r}, which is not a text; rename it")
        values = np.asarray(given)
        if values.ndim != 1:
            raise UsageError(
                f"{SOURCE}, column {name}: it has the shape {values.shape}; a column has one value per row"
            )
        rows = len(values) if rows is None else rows
        if len(values) != rows:
            raise UsageError(f"{SOURCE}, column {name}: {len(values)} values, where other columns have {rows}")
        if values.dtype.kind in "OUS":
            values = _of_objects(values)
        if values.dtype.kind == "U":
            text[name] = values
        else:
            numbers[name] = _finite(name, values)
    if not rows:
        raise UsageError(f"{SOURCE} has no {'columns' if rows is None else 'rows'}")
    return Table(SOURCE, numbers, False, {"file": SOURCE, "simulated": False}, text=text, rows=range(1, rows + 1))


def _of_objects(values: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Objects as numbers, or as text where one of them is text."""
    gaps = np.array([value is None or value != value or str(value) == "<NA>" for value in values.tolist()])  # noqa: PLR0124
    if any(isinstance(value, str) for value in values.tolist()):
        return np.array(["" if gap else str(value) for value, gap in zip(values.tolist(), gaps, strict=True)])
    return np.array([np.nan if gap else value for value, gap in zip(values.tolist(), gaps, strict=True)])


def _finite(name: str, values: np.ndarray[Any, Any]) -> np.ndarray[Any, np.dtype[np.float64]]:
    try:
        found = values.astype(np.float64)
    except (TypeError, ValueError):
        raise UsageError(f"{SOURCE}, column {name}: it holds {values.dtype}, not numbers; convert it") from None
    if values.dtype.kind not in "biuf":
        raise UsageError(f"{SOURCE}, column {name}: it holds {values.dtype}, not numbers; convert it")
    bad = np.flatnonzero(np.isinf(found))
    if len(bad):
        raise UsageError(
            f"{SOURCE}, row {bad[0] + 1}, column {name}: {found[bad[0]]} is not a finite number; use NaN if there was "
            f"no reading"
        )
    return found
