"""Lines, paragraphs and tables as HTML, for notebooks: the same blocks as on a terminal."""

from __future__ import annotations

import io
from collections.abc import Iterable
from html import escape
from typing import TYPE_CHECKING, assert_never

from rich.console import Console
from rich.terminal_theme import DEFAULT_TERMINAL_THEME
from rich.text import Text

from rig.procedures.present.blocks import Block, Grid, Line, Paragraph
from rig.procedures.present.visible import visible

if TYPE_CHECKING:
    from rich.segment import Segment

_CONSOLE = Console(file=io.StringIO())
"""A console that only resolves the names of styles."""
_LINE = "white-space:pre-wrap"
_TABLE = "border-collapse:collapse;margin:0.5em 0"
_CELL = "padding:0.1em 0.6em;white-space:pre-wrap"
_RULE = ";border-bottom:1px solid"
_BOX = ";border:1px solid"


def html(blocks: Iterable[Block]) -> str:
    """Draw the blocks in order. Text that is not markup of a block is escaped."""
    return f'<div class="rig">{"".join(map(_block, blocks))}</div>'


def _block(block: Block) -> str:
    match block:
        case Line(text):
            return f'<div style="{_LINE}">{_inline(text) or "&nbsp;"}</div>'
        case Paragraph(text, indent):
            return f'<p style="margin:0 0 0 {indent}ch;{_LINE}">{_inline(text)}</p>'
        case Grid():
            return _table(block)
        case _:
            assert_never(block)


def _table(grid: Grid) -> str:
    cell = _CELL + (_BOX if grid.frame == "box" else "")
    head = cell + (_RULE if grid.frame in ("plain", "rule") else "")
    rows = "".join(_row("td", row, cell, numbers=grid.frame == "rule") for row in grid.rows)
    title = f'<caption style="text-align:left;{_LINE}">{_inline(grid.title)}</caption>' if grid.title else ""
    names = "" if grid.frame == "none" else _row("th", grid.columns, head, numbers=grid.frame == "rule")
    return f'<table style="{_TABLE}">{title}<thead>{names}</thead><tbody>{rows}</tbody></table>'


def _row(tag: str, cells: Iterable[str], style: str, *, numbers: bool) -> str:
    sides = ("right" if numbers and place else "left" for place, _ in enumerate(cells))
    drawn = (
        f'<{tag} style="{style};text-align:{side}">{_inline(cell)}</{tag}>'
        for side, cell in zip(sides, cells, strict=True)
    )
    return f"<tr>{''.join(drawn)}</tr>"


def _inline(markup: str) -> str:
    text = Text.from_markup(visible(markup), emoji=False, end="")
    return "".join(map(_segment, text.render(_CONSOLE)))


def _segment(segment: Segment) -> str:
    style = segment.style.get_html_style(DEFAULT_TERMINAL_THEME) if segment.style is not None else ""
    words = escape(segment.text)
    return f'<span style="{escape(style)}">{words}</span>' if style else words
