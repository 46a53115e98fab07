"""Lines, paragraphs and tables on a terminal."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import TYPE_CHECKING, assert_never

from rich import box
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from rig.procedures.present.blocks import Block, Grid, Line, Paragraph

if TYPE_CHECKING:
    from rich.console import Console

_NUMBERS = re.compile(r"[-+\d.eE,%()/: ]*|nan|-?inf")
_NAME = 12
"""Characters of a name in a line, at least."""


def show(blocks: Iterable[Block], console: Console) -> None:
    """Print the blocks in order."""
    for block in blocks:
        match block:
            case Line(text, wrapped):
                console.print(text, soft_wrap=not wrapped)
            case Paragraph(text, indent) if console.is_terminal:
                console.print(Padding(text, (0, 0, 0, indent)))
            case Paragraph(text, indent):
                console.print(" " * indent + text, soft_wrap=True)
            case Grid():
                print_whole(_table(block), console)
            case _:
                assert_never(block)


def print_whole(table: Table, console: Console) -> None:
    """Print a table with nothing cut: long names fold, and a number is on one line."""
    for column in table.columns:
        column.overflow = "fold"
        cells = [Text.from_markup(str(cell)).plain for cell in column.cells]
        longest = max(map(len, cells), default=0)
        column.min_width = longest if all(_NUMBERS.fullmatch(one) for one in cells) else min(longest, _NAME)
    console.print(table, crop=False)


def _table(grid: Grid) -> Table:
    apart = (0, grid.apart, 0, 0)
    match grid.frame:
        case "box":
            table = Table(*grid.columns, title=grid.title or None, title_justify="left")
        case "none":
            table = Table(*grid.columns, padding=apart, box=None)
        case "plain" | "rule":
            table = Table(*grid.columns, box=box.SIMPLE_HEAD, padding=apart, pad_edge=False, show_edge=False)
            table.title, table.title_justify = grid.title or None, "left"
            if grid.frame == "rule":
                for column in table.columns[1:]:
                    column.justify = "right"
    for row in grid.rows:
        table.add_row(*row)
    return table
