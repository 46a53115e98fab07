"""How the command line says that gross errors are in a fit, or left out of it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from rich.markup import escape

from procedures.blocks import Block, Line


def show_gross(found: Mapping[str, Any]) -> Iterator[Block]:
    """The sentence of one sensor: loud where its calibration has gross errors in it."""
    style = "bold red" if found["rows"] and found["kept"] else "yellow" if found["rows"] else "dim"
    yield Line(f"  [{style}]{escape(found['sentence'])}[/]")


def show_left_out(data: Mapping[str, Any]) -> Iterator[Block]:
    """Rows of the file that the calibration does not have in it."""
    rows = data["rows_left_out"]
    if rows:
        numbers = ", ".join(str(row) for row in rows)
        yield Line(f"[yellow]left out of this calibration:[/] row{'s' * (len(rows) > 1)} {numbers}")
