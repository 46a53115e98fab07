"""Cells of a CSV table as text, column by column."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import numpy as np

_SPECIAL = re.compile('[,"\\r\\n]')
_WHOLE = 1e15
"""Numbers from which whole ones are written with a point."""


def cells_of(values: Sequence[Any] | np.ndarray[Any, Any]) -> tuple[Sequence[str], bool]:
    """Cells of one column, and whether none of them needs quotes.

    Text stays as it is; whole numbers are without a point, others in full; of NaN there is nothing.
    """
    array = np.asarray(values)
    if array.dtype.kind not in "fiub":
        text = [value if isinstance(value, str) else cells_of([float(value)])[0][0] for value in values]
        return text, not any(_SPECIAL.search(cell) for cell in set(text))
    numbers = array.astype(np.float64)
    whole = (np.abs(numbers) < _WHOLE) & (np.trunc(numbers) == numbers)
    if whole.all():
        return list(map(str, numbers.astype(np.int64).tolist())), True
    cells = list(map(repr, numbers.tolist()))
    for i in np.flatnonzero(whole):
        cells[i] = str(int(numbers[i]))
    for i in np.flatnonzero(np.isnan(numbers)):
        cells[i] = ""
    return cells, True
