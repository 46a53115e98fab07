"""What a person reads of a result: lines, paragraphs and tables, drawn alike on a terminal, a page and in a notebook.

Texts have rich's markup (`[bold]x[/]`); whatever comes from a file is escaped by whoever makes the text.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

from rich.markup import escape

from procedures.table import Table
from procedures.words import incomplete


@dataclass(frozen=True)
class Line:
    """One line, however long; `wrapped` at the width of the terminal where that is read more easily."""

    text: str = ""
    wrapped: bool = False


@dataclass(frozen=True)
class Paragraph:
    """A text that is wrapped, with all of its lines indented."""

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
        apart: spaces between the columns of a table without a box.
        rows: of cells, as many as there are columns.

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
    """What is put beside everything that comes from a simulated run."""
    return "[bold magenta]SIMULATED[/] " if simulated else ""


def headline(file: str, table: Table) -> Line:
    """Whose observations, how many, and whether more are to come."""
    missing = incomplete(table.provenance)
    more = f" ([yellow]{escape(missing)}[/])" if missing else ""
    return Line(f"{simulated_mark(table.simulated)}[bold]{escape(file)}[/]: {len(table)} observations{more}")
