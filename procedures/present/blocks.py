"""Output for people: lines, paragraphs and tables, the same on a terminal, a page and in a notebook.

Texts have rich's markup (`[bold]x[/]`); text from files is escaped by the author of the text.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

from rich.markup import escape

from rig.procedures.present.words import incomplete
from rig.procedures.tables.table import CORRECTED, Table


@dataclass(frozen=True)
class Line:
    """One line of any length; `wrapped` at the width of the terminal if that is easier to read."""

    text: str = ""
    wrapped: bool = False


@dataclass(frozen=True)
class Paragraph:
    """A wrapped text with all lines indented."""

    text: str
    indent: int = 0


@dataclass
class Grid:
    """A table.

    Attributes:
        columns: headings.
        title: above it.
        frame: "box"; "plain", a rule below the headings alone; "rule", the same with numbers to the right, for tables
            as wide as a terminal; or "none".
        apart: number of spaces between the columns of a table without a box.
        rows: lists of cells, one for each column.
    """

    columns: Sequence[str]
    title: str = ""
    frame: Literal["box", "plain", "rule", "none"] = "box"
    apart: int = 1
    rows: list[tuple[str, ...]] = field(default_factory=list)

    def add_row(self, *cells: str) -> None:
        """One more row."""
        self.rows.append(cells)


Block = Line | Paragraph | Grid


def simulated_mark(simulated: bool) -> str:
    """Mark of everything from a simulated run."""
    return "[bold magenta]SIMULATED[/] " if simulated else ""


def headline(file: str, table: Table) -> Line:
    """Sensors, number of observations, and whether the run continues."""
    missing = incomplete(table.provenance)
    more = f" ([yellow]{escape(missing)}[/])" if missing else ""
    corrected = len(table.provenance.get(CORRECTED, ()))
    more += f", [yellow]corrections of typed entries: {corrected}[/]" if corrected else ""
    return Line(f"{simulated_mark(table.simulated)}[bold]{escape(file)}[/]: {len(table)} observations{more}")
