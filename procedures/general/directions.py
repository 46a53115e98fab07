"""Words for the direction of approach."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.procedures.errors import DataError

_UP = (
    "up", "upward", "upwards", "increasing", "increase", "ascending", "loading", "rising", "rise", "forward", "+", "+1",
    "auf", "aufwärts", "aufwaerts", "steigend", "hin", "belastung", "montée", "montee",
)  # fmt: skip
_DOWN = (
    "down", "downward", "downwards", "decreasing", "decrease", "descending", "unloading", "falling", "fall", "backward",
    "reverse", "-", "-1", "\u2212", "ab", "abwärts", "abwaerts", "fallend", "zurück", "zurueck", "entlastung",
    "descente",
)  # fmt: skip
_SIDES = dict.fromkeys(_UP, 1.0) | dict.fromkeys(_DOWN, -1.0)
"""+1 or -1 by word, as `_word` writes it."""


def _word(cell: str) -> str:
    return unicodedata.normalize("NFC", cell).strip().lower()


def are_directions(cells: Iterable[str]) -> bool:
    """Whether all texts are words for a direction."""
    return all(_word(cell) in _SIDES for cell in cells)


def sides_of(cells: Iterable[str]) -> FloatArray:
    """(n,) +1 or -1 of each word; all `are_directions`."""
    return np.array([_SIDES[_word(cell)] for cell in cells], np.float64)


def read_direction(text: str) -> tuple[str, tuple[str, str] | None]:
    """The column of `--direction COLUMN` or `--direction COLUMN=UP,DOWN`, and its two words, None for known ones.

    Raises:
        DataError: an equal sign is followed by a comma, but not by two words.
    """
    name, _, words = text.rpartition("=")
    if not name or "," not in words:
        return text, None
    up, _, down = (word.strip() for word in words.partition(","))
    if not up or not down or up == down or "," in down:
        raise DataError(f"--direction {text}: give a column, or a column and its two words: --direction side=auf,ab")
    return name, (up, down)


def direction_option(name: str, words: tuple[str, str] | None) -> str:
    """What `read_direction` reads."""
    return name if words is None else f"{name}={','.join(words)}"


_NAMED = re.compile(r"^dir|direction|updown|sense|side", re.IGNORECASE)
_AGREES = 0.7
"""Share of a setting's changes whose sign a direction of approach has."""
LOOKS_LIKE, LEAST_MOVES = 0.9, 4
"""Share of agreeing changes, and number of changes each way, from which two unknown words are taken for a direction."""


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
            side = sides_of(v.tolist()) if are_directions(v.tolist()) else None
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


_FLAGS = frozenset(
    ("true", "false", "yes", "no", "on", "off", "ok", "nok", "pass", "fail", "good", "bad", "valid", "invalid")
)
"""Words of a column that says whether something holds: no side of approach."""


def likely_words(cells: Sequence[str], settings: Iterable[FloatArray]) -> tuple[str, str] | None:
    """The words for up and for down of a column of two other words that goes with the changes of a setting; else None.

    Args:
        cells: (n,) in the order of the table.
        settings: (n,) columns of numbers.
    """
    levels = sorted(set(cells))
    if (
        len(levels) != 2
        or {level.lower() for level in levels} <= _FLAGS
        or any(not word or set(word) & {",", "="} for word in levels)
        or are_directions(cells)
    ):
        return None
    side = np.array([1.0 if cell == levels[0] else -1.0 for cell in cells])
    for v in settings:
        change = np.sign(np.diff(v))
        moved = change != 0
        same = change[moved] == side[1:][moved]
        for words, agree in ((levels, same), (levels[::-1], ~same)):
            up = side[1:][moved] == (1.0 if words == levels else -1.0)
            if min(up.sum(), (~up).sum()) >= LEAST_MOVES and agree.mean() >= LOOKS_LIKE:
                return words[0], words[1]
    return None


def _agree(side: FloatArray, setting: FloatArray) -> bool:
    change = np.sign(np.diff(setting))
    moved = (change != 0) & (side[1:] != 0)
    return bool(np.any(moved)) and float(np.mean(change[moved] == side[1:][moved])) >= _AGREES
