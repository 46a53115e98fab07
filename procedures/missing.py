"""Rows with missing values: their result is empty, with the reason in the flag; the others are inferred."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fitter.arrays import FloatArray
from procedures.table import Table


def empty_rows(inputs: Mapping[str, FloatArray]) -> NDArray[Any]:
    """(n,) missing values of a row, in words; empty for a complete row."""
    lacks = {name: ~np.isfinite(values) for name, values in inputs.items()}
    flag = np.full(len(next(iter(inputs.values()))), "", dtype=object)
    for i in np.flatnonzero(np.any(list(lacks.values()), axis=0)):
        flag[i] = f"no value of {', '.join(name for name, gaps in lacks.items() if gaps[i])}"
    return flag


def incomplete_rows(table: Table, inputs: Mapping[str, FloatArray]) -> list[tuple[int, str]]:
    """(row in the file, column) of every missing value."""
    return [(table.row(int(i)), name) for name, values in inputs.items() for i in np.flatnonzero(~np.isfinite(values))]
