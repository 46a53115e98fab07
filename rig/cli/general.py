"""Tables of any kind on the command line: the parts columns play, and how fits and traces are shown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.markup import escape
from rich.table import Table

from procedures.words import unnamed, verdict_of
from rig.cli.effects import paragraph, show_certificate, show_effect
from rig.cli.gross import show_gross, show_left_out
from rig.cli.show import err, number, out, print_json, show_unused
from rig.errors import UsageError


def _columns(text: str) -> Any:
    return typer.Option(help=f"any table: {text}", show_default=False)


GroupOption = Annotated[
    list[str] | None, _columns("column(s) whose levels may have offsets or gains of their own; repeatable, or a,b")
]
WholePlotOption = Annotated[str | None, _columns("column(s, comma between) of whole plots, whose error is declared")]
ReplicateOption = Annotated[str | None, _columns("column of repeats, whose offsets are declared")]
TimeOption = Annotated[str | None, _columns("column of the time, in any unit")]
DirectionOption = Annotated[
    str | None, _columns("column of +-1 or of a velocity; or a setting, for the side it was approached from")
]
CandidatesOption = Annotated[list[str] | None, _columns("the only other columns to look at; repeatable, or a,b")]
IgnoreOption = Annotated[list[str] | None, _columns("column(s) not to look at; repeatable, or a,b")]
WrapOption = Annotated[
    float | None, _columns("the response is an angle: bring it to half a turn of this size either side")
]


def check_no_parts(parts: Mapping[str, Any]) -> None:
    """Refuse options that only go with --response."""
    for name, value in parts.items():
        if value is not None:
            raise UsageError(
                f"--{name.replace('_', '-')} names columns of any table; it goes with --response and --formula"
            )


def trace_any(
    path: Path, response: str, formula: str | None, parts: Mapping[str, Any], *, as_json: bool, report: Path | None
) -> None:
    """Trace a table of any kind and show what was found."""
    from procedures.general.evaluate import trace_general_table
    from procedures.general.roles import Roles

    if formula is None:
        raise UsageError("--response needs --formula, the declared model, such as --formula '1 + x'")
    candidates = parts["candidates"]
    traced = trace_general_table(
        path,
        Roles(
            response,
            formula,
            group=_names(parts["group"]),
            whole_plot=_names([parts["whole_plot"]] if parts["whole_plot"] else None),
            replicate=parts["replicate"],
            time=parts["time"],
            direction=parts["direction"],
            candidates=None if candidates is None else _names(candidates),
            ignore=_names(parts["ignore"]),
            wrap=parts["wrap"],
        ),
    )
    result = traced.to_json()
    if report is not None:
        from rig.report.general import write_general_report

        write_general_report(report, traced)
        err.print(f"report: {escape(str(report))}", soft_wrap=True)
    if as_json:
        print_json(result)
    else:
        show_general_trace(result)
    show_unused(result["unused"])


def _names(given: Sequence[str] | None) -> tuple[str, ...]:
    """Names from repeated options, each of which may hold several with commas between."""
    return tuple(name for text in given or () for part in text.split(",") if (name := part.strip()))


def show_general_trace(result: Mapping[str, Any]) -> None:
    """Error before and after, the effects found, what remains, and what was taken for what."""
    out.print(f"[bold]{escape(result['data']['file'])}[/]: {result['data']['points']} rows", soft_wrap=True)
    for name, found in result["sensors"].items():
        out.print(
            f"[bold]{escape(name)}[/] (declared {escape(found['declared'])}): [bold]{escape(verdict_of(found))}[/]"
        )
        table = Table("", "before", "after")
        for key, label in (
            ("sigma_E", "standard error of one row"),
            ("sigma_pure", "of rows that repeat one setting"),
            ("sigma_subplot", "within whole plots"),
            ("sigma_wholeplot", "between whole plots"),
            ("cv_rms", "left-out error"),
        ):
            if found["before"][key] is not None or found["after"][key] is not None:
                table.add_row(label, *(number(found[side][key], 4) for side in ("before", "after")))
        out.print(table)
        for effect in found["effects"]:
            show_effect(effect)
        for line in unnamed(found):
            paragraph(f"[yellow]{escape(line)}[/]", 2)
        for note in found["notes"]:
            paragraph(f"[dim]{escape(note)}[/]", 2)
        show_certificate(found)


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
    show_left_out(result["data"])
    show_gross(result["gross_errors"])
    for note in result.get("notes", ()):
        out.print(f"  [yellow]{escape(note)}[/]", soft_wrap=True)
