"""Rows that lack a value: their result is empty, with the reason in the flag, and the others are inferred."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fitter.arrays import FloatArray
from procedures.table import Table


def empty_rows(inputs: Mapping[str, FloatArray]) -> NDArray[Any]:
    """(n,) what a row lacks, in words; empty where it is complete."""
    lacks = {name: ~np.isfinite(values) for name, values in inputs.items()}
    flag = np.full(len(next(iter(inputs.values()))), "", dtype=object)
    for i in np.flatnonzero(np.any(list(lacks.values()), axis=0)):
        flag[i] = f"no value of {', '.join(name for name, gaps in lacks.items() if gaps[i])}"
    return flag


def incomplete_rows(table: Table, inputs: Mapping[str, FloatArray]) -> list[tuple[int, str]]:
    """(row in the file, column) of every value that is missing."""
    return [(table.row(int(i)), name) for name, values in inputs.items() for i in np.flatnonzero(~np.isfinite(values))]
