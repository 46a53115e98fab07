"""Display of gross errors in a fit, or left out of it, on the command line."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from rich.markup import escape

from rig.procedures.present.blocks import Block, Line


def show_gross(found: Mapping[str, Any]) -> Iterator[Block]:
    """The sentence of one sensor, emphasised if its calibration includes gross errors."""
    style = "bold red" if found["rows"] and found["kept"] else "yellow" if found["rows"] else "dim"
    yield Line(f"  [{style}]{escape(found['sentence'])}[/]")


def show_left_out(data: Mapping[str, Any]) -> Iterator[Block]:
    """Rows of the file that are left out of the calibration."""
    rows = data["rows_left_out"]
    if rows:
        numbers = ", ".join(str(row) for row in rows)
        yield Line(f"[yellow]left out of this calibration:[/] row{'s' * (len(rows) > 1)} {numbers}")
