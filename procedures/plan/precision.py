"""Expected precision of a calibration, from its design and expected errors, before the run."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Precision:
    """Predicted precision as a table.

    Attributes:
        columns: headings with units; () if nothing is predicted.
        rows: JSON values, one row per line.
        cells: the same as text.
        assuming: the assumptions, a sentence.
        further: further sentences.
    """

    columns: tuple[str, ...] = ()
    rows: Sequence[Mapping[str, Any]] = ()
    cells: Sequence[tuple[str, ...]] = ()
    assuming: str = ""
    further: tuple[str, ...] = ()


def source_of(names: Sequence[str], stated: Collection[str]) -> str:
    """Where an expected error is from: the procedure, or nobody stated it."""
    return f"expect.{' and '.join(names)}" + (
        "" if set(names) <= set(stated) else ", which the procedure does not state"
    )
