"""A table with what was inferred from it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from procedures.unused import Unused


@dataclass(frozen=True)
class Inference:
    """A table with what was inferred from it.

    Attributes:
        columns: the input's, and those that were added.
        added: names of the latter.
        notes: what a reader should know.
        flagged: rows with something to say in a flag column.
        quantities: names of what was inferred; each has columns with _sd, _lo95 and _hi95 after its name.
        unused: columns and rows that play no part.
        zeros: pressure: what was taken as zero, by output, ready for JSON.

    """

    columns: Mapping[str, Any]
    added: tuple[str, ...]
    notes: tuple[str, ...]
    flagged: int
    quantities: tuple[str, ...] = ()
    unused: Unused = field(default_factory=Unused)
    zeros: Mapping[str, Any] = field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """What `rig infer --json` prints; the numbers are in the CSV."""
        return {
            "rows": len(next(iter(self.columns.values()))),
            "flagged": self.flagged,
            "quantities": list(self.quantities),
            "added": list(self.added),
            "notes": list(self.notes),
            "unused": self.unused.to_json(),
            "zeros": dict(self.zeros),
        }
