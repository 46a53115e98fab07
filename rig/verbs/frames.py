"""Results as data frames (pandas) and as labelled arrays (xarray), with units. Both libraries are optional."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from rig.extras import needed
from rig.procedures.tables.unused import known_unit_of

if TYPE_CHECKING:
    from pandas import DataFrame
    from xarray import Dataset

ROW = "row"
"""Name of the one dimension of every labelled array."""
_ENDS = ("_sd", "_lo95", "_hi95")
"""Units of columns whose names do not end in them."""


@dataclass(frozen=True, eq=False)
class Frame:
    """A table.

    Attributes:
        columns: (n,) values by name: numbers, text, booleans.
        units: unit by name, for columns that have one.
        about: metadata; only numbers and text, which every file format can store.
    """

    columns: Mapping[str, np.ndarray[Any, Any]]
    units: Mapping[str, str]
    about: Mapping[str, str | int | float] = field(default_factory=dict)

    def to_pandas(self) -> DataFrame:
        """As a pandas data frame; `attrs["units"]` has the units by column. Raises `UsageError` if pandas is not
        installed.
        """
        frame: DataFrame = needed("pandas", "pandas").DataFrame(dict(self.columns))
        frame.attrs["units"] = dict(self.units)
        for name, value in self.about.items():
            frame.attrs[name] = value
        return frame

    def to_xarray(self) -> Dataset:
        """As an xarray dataset; variables have `attrs["units"]`. Raises `UsageError` if xarray is not installed."""
        variables = {
            name: (ROW, values, {"units": self.units[name]} if name in self.units else {})
            for name, values in self.columns.items()
        }
        found: Dataset = needed("xarray", "xarray").Dataset(variables, attrs=dict(self.about))
        return found


def of_columns(columns: Mapping[str, Any], about: Mapping[str, str | int | float]) -> Frame:
    """Units of columns whose names end in their unit."""
    units = {name: unit for name in columns if (unit := _unit(name))}
    arrays = {name: np.asarray(values) for name, values in columns.items()}
    return Frame({n: v.astype(str) if v.dtype == object else v for n, v in arrays.items()}, units, about)


def of_rows(
    rows: Iterable[Mapping[str, Any]],
    text: Collection[str],
    numbers: Collection[str],
    about: Mapping[str, str | int | float],
    units: Mapping[str, str] | None = None,
) -> Frame:
    """A table from rows; a missing value is "" in a column of text, NaN in a column of numbers.

    Args:
        rows: values by column.
        text: columns of text, which come first.
        numbers: columns of numbers.
        about: see `Frame`.
        units: unit by name, for columns that have one.
    """
    every = list(rows)
    words = {name: [row.get(name) for row in every] for name in text}
    values = {name: [row.get(name) for row in every] for name in numbers}
    return Frame(
        {name: np.array(["" if v is None else str(v) for v in column]) for name, column in words.items()}
        | {name: np.array([np.nan if v is None else v for v in column], float) for name, column in values.items()},
        units or {},
        about,
    )


def _unit(name: str) -> str:
    for end in _ENDS:
        name = name.removesuffix(end)
    return known_unit_of(name)
