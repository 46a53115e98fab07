"""A table with inferred quantities."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from procedures.unused import Unused


@dataclass(frozen=True)
class Inference:
    """A table with inferred quantities.

    Attributes:
        columns: the input's, and the added ones.
        added: names of the added ones.
        notes: notes for readers.
        flagged: number of rows with a flag.
        quantities: names of the inferred quantities; each has columns with _sd, _lo95 and _hi95 after its name.
        unused: unused columns and rows.
        zeros: pressure: the used zero, by output, as JSON values.
    """

    columns: Mapping[str, Any]
    added: tuple[str, ...]
    notes: tuple[str, ...]
    flagged: int
    quantities: tuple[str, ...] = ()
    unused: Unused = field(default_factory=Unused)
    zeros: Mapping[str, Any] = field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """JSON values for `rig infer --json`; the numbers are in the CSV."""
        return {
            "rows": len(next(iter(self.columns.values()))),
            "flagged": self.flagged,
            "quantities": list(self.quantities),
            "added": list(self.added),
            "notes": list(self.notes),
            "unused": self.unused.to_json(),
            "zeros": dict(self.zeros),
        }
