"""How the command line shows fits of tables of any kind."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rich.markup import escape
from rich.table import Table

from rig.cli.show import number, out


def show_general_fit(file: str, result: Mapping[str, Any]) -> None:
    """Coefficients with standard errors and degrees of freedom, and the errors they stand on."""
    title = f"{escape(result['response'])} ~ {escape(result['formula'])}"
    out.print(f"[bold]{escape(file)}[/]: {result['data']['points']} rows", soft_wrap=True)
    table = Table("term", "estimate", "standard error", "df", title=title, title_justify="left")
    for name, value in result["coefficients"].items():
        table.add_row(escape(name), number(value["estimate"], 8), number(value["stderr"], 3), number(value["df"], 4))
    out.print(table)
    for key, what in (
        ("sigma_E", "standard error of one row"),
        ("sigma_subplot", "of one row within its whole plot"),
        ("sigma_wholeplot", "shared by the rows of a whole plot"),
        ("sigma_replicate", "shared by the whole plots of a replication"),
    ):
        if result.get(key) is not None:
            out.print(f"  {key:<16} {number(result[key], 5)}  {what}")
    for note in result.get("notes", ()):
        out.print(f"  [yellow]{escape(note)}[/]", soft_wrap=True)
