"""Words for the direction of approach."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from fitter.arrays import FloatArray

_UP = ("up", "upward", "upwards", "increasing", "increase", "ascending", "loading", "rising", "forward", "+", "+1")
_DOWN = (
    "down", "downward", "downwards", "decreasing", "decrease", "descending", "unloading", "falling", "backward",
    "reverse", "-", "-1", "\u2212",
)  # fmt: skip
SIDES = dict.fromkeys(_UP, 1.0) | dict.fromkeys(_DOWN, -1.0)
"""+1 or -1 by word, in lower case."""


def are_directions(cells: Iterable[str]) -> bool:
    """Whether all texts are words for a direction."""
    return all(cell.strip().lower() in SIDES for cell in cells)


_NAMED = re.compile(r"^dir|direction|updown|sense|side", re.IGNORECASE)
_AGREES = 0.7
"""Share of a setting's changes whose sign a direction of approach has."""


def named_direction(name: str, values: FloatArray) -> bool:
    """Whether a column of +1, -1 and perhaps 0 is a direction by its name."""
    return set(np.unique(values).tolist()) <= {-1.0, 0.0, 1.0} and _NAMED.search(name) is not None


def approached_by(names: Sequence[str], columns: Mapping[str, Any], settings: Mapping[str, FloatArray]) -> str | None:
    """The one column of `names` that says from which side a setting was approached; None if there is not one.

    Args:
        names: columns of the table without another role.
        columns: (n,) each, in order of time.
        settings: (n,) each, in the same order.
    """
    found = []
    for name in names:
        v = columns[name]
        if v.dtype.kind in "fiu":
            side = np.asarray(v, np.float64) if named_direction(name, v) else None
        else:
            side = np.array([SIDES[word.strip().lower()] for word in v]) if are_directions(v.tolist()) else None
        if side is not None and len(np.unique(side)) > 1 and any(_agree(side, x) for x in settings.values()):
            found.append(name)
    return found[0] if len(found) == 1 else None


def with_changes(side: FloatArray, settings: Iterable[FloatArray]) -> FloatArray:
    """(n,) sides; a row without one has that of the last change of the setting that the others belong to.

    Args:
        side: (n,) +1, -1 or 0, in order of time.
        settings: (n,) each, in the same order.
    """
    own = next((v for v in settings if _agree(side, v)), None)
    if own is None:
        return side
    filled, change = np.array(side, np.float64), np.sign(np.diff(own, prepend=own[:1]))
    for i in range(1, len(filled)):
        if filled[i] == 0.0:
            filled[i] = change[i] or filled[i - 1]
    return filled


def _agree(side: FloatArray, setting: FloatArray) -> bool:
    change = np.sign(np.diff(setting))
    moved = (change != 0) & (side[1:] != 0)
    return bool(np.any(moved)) and float(np.mean(change[moved] == side[1:][moved])) >= _AGREES
