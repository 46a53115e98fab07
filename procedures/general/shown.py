"""Display of tables of any kind on the command line: roles of columns, fits and traces."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from rich.markup import escape

from procedures.before_after import compared
from procedures.blocks import Block, Grid, Line, Paragraph
from procedures.effects_shown import show_certificate, show_effect
from procedures.general.evaluate import GeneralTraced
from procedures.gross_shown import show_gross, show_left_out
from procedures.numbers import number
from procedures.words import unnamed, verdict_of


def show_general_trace(traced: GeneralTraced) -> Iterator[Block]:
    """Error before and after, the effects found, the remainder, and the roles of columns."""
    result = traced.to_json()
    yield Line(f"[bold]{escape(result['data']['file'])}[/]: {result['data']['points']} rows")
    for name, found in result["sensors"].items():
        yield Line(
            f"[bold]{escape(name)}[/] (declared {escape(found['declared'])}): [bold]{escape(verdict_of(found))}[/]",
            wrapped=True,
        )
        table = Grid(("", "before", "after"))
        for row in compared(traced.outcome):
            table.add_row(row.label, row.before, row.after)
        yield table
        for effect in found["effects"]:
            yield from show_effect(effect)
        for line in unnamed(found):
            yield Paragraph(f"[yellow]{escape(line)}[/]", 2)
        for note in found["notes"]:
            yield Paragraph(f"[dim]{escape(note)}[/]", 2)
        yield from show_certificate(found)


def show_general_fit(file: str, result: Mapping[str, Any]) -> Iterator[Block]:
    """Coefficients with standard errors and degrees of freedom, and the underlying errors."""
    title = f"{escape(result['response'])} ~ {escape(result['formula'])}"
    yield Line(f"[bold]{escape(file)}[/]: {result['data']['points']} rows")
    table = Grid(("term", "estimate", "standard error", "df"), title=title)
    for name, value in result["coefficients"].items():
        table.add_row(escape(name), number(value["estimate"], 8), number(value["stderr"], 3), number(value["df"], 4))
    yield table
    for key, what in (
        ("sigma_E", "standard error of one row"),
        ("sigma_subplot", "of one row within its whole plot"),
        ("sigma_wholeplot", "shared by the rows of a whole plot"),
        ("sigma_replicate", "shared by the whole plots of a replication"),
    ):
        if result.get(key) is not None:
            yield Line(f"  {key:<16} {number(result[key], 5)}  {what}", wrapped=True)
    yield from show_left_out(result["data"])
    yield from show_gross(result["gross_errors"])
    for note in result.get("notes", ()):
        yield Line(f"  [yellow]{escape(note)}[/]")
