"""Words for the direction of approach."""

from __future__ import annotations

from collections.abc import Iterable

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
