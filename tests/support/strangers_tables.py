"""Tables of strangers' sets that once showed a fault, as their authors' code made them (tests/strangers).

Their sets were opened, and are in the history of this repository: first (ice, outgassing, a regulator), second
(a notch), third (creep, evaporation, shedding), fourth (pairs), seventh (one-sided).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

FOLDER = Path(__file__).parents[1] / "strangers"


@dataclass(frozen=True)
class Table:
    """Text of a table, and options of `rig trace` as on the command line."""

    csv: str
    options: tuple[str, ...]


def table(name: str, options: str = "") -> Table:
    """A table by the name of its hidden cause; each word of `options` is one, `+` joins words of a formula."""
    return Table((FOLDER / f"{name}.csv").read_text(), tuple(one.replace("_+_", " + ") for one in options.split()))
