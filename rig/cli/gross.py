"""How the command line says that gross errors are in a fit, or left out of it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rich.markup import escape

from rig.cli.show import out


def show_gross(found: Mapping[str, Any]) -> None:
    """The sentence of one sensor: loud where its calibration has gross errors in it."""
    style = "bold red" if found["rows"] and found["kept"] else "yellow" if found["rows"] else "dim"
    out.print(f"  [{style}]{escape(found['sentence'])}[/]", soft_wrap=True)


def show_left_out(data: Mapping[str, Any]) -> None:
    """Rows of the file that the calibration does not have in it."""
    rows = data["rows_left_out"]
    if rows:
        numbers = ", ".join(str(row) for row in rows)
        out.print(f"[yellow]left out of this calibration:[/] row{'s' * (len(rows) > 1)} {numbers}", soft_wrap=True)
