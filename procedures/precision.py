"""How precise a calibration will be, from its design and the errors one expects, before the night is spent."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Precision:
    """Predicted precision as a table.

    Attributes:
        columns: headings, units included; () where nothing is predicted.
        rows: JSON-ready, one a line.
        cells: the same as text.
        assuming: what it stands on, a sentence.
        further: what else can be said, a sentence each.

    """

    columns: tuple[str, ...] = ()
    rows: Sequence[Mapping[str, Any]] = ()
    cells: Sequence[tuple[str, ...]] = ()
    assuming: str = ""
    further: tuple[str, ...] = ()
