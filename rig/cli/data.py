"""`rig fit`, `rig trace`: what the data say."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.markup import escape

from procedures.kind import Kind
from procedures.results import Fitted, Page, Traced
from rig.atomic import check_files, write_whole
from rig.cli import app
from rig.cli.kind_options import chosen, with_options_of_kinds
from rig.cli.run import JsonOption
from rig.cli.show import err, out, print_json, show_unused
from rig.errors import ExitCode, UsageError
from rig.present.terminal import show

DataArgument = Annotated[Path, typer.Argument(help="a run file, or a CSV table", show_default=False)]


@app.command()
@with_options_of_kinds(lambda kind: kind.fit_options)
def fit(
    data: DataArgument,
    as_json: JsonOption = False,
    out_file: Annotated[
        Path | None, typer.Option("--out", "-o", help="write the calibration to this JSON file", show_default=False)
    ] = None,
    report: Annotated[
        Path | None, typer.Option(help="write tables and plots as HTML, where the kind has such", show_default=False)
    ] = None,
    leave_out: Annotated[
        list[str] | None,
        typer.Option(
            "--leave-out",
            help="fit without these rows and say so in the calibration: 'gross' for the gross errors found, or row "
            "numbers of the file (12,31); repeatable",
            show_default="every row is fitted, and gross errors are named",
        ),
    ] = None,
    confirmed_by: Annotated[
        Path | None,
        typer.Option(
            "--confirmed-by",
            help="keep the calibration with the causes that this later run file confirmed (see rig confirm)",
            show_default=False,
        ),
    ] = None,
    *,
    given: dict[str, Any],
) -> int:
    """Fit the declared model to every sensor; analyse replications, or whole plots with all methods side by side.

    Examples: `rig fit runs/20260115T180000-night-1a2b.sqlite`, `rig fit RUN --traced --temperature --out package.json`,
    `rig fit RUN --points 73`, `rig fit table.csv --response y --formula "1 + x"`
    """
    from rig.effects import laboratory_effects  # noqa: PLC0415
    from rig.tables import FileSource  # noqa: PLC0415

    check_files([out_file, report], [data, *filter(None, (confirmed_by,))])
    kind, options = chosen(FileSource(data), given, lambda one: one.fit_options)
    fitted: Fitted
    if confirmed_by is not None:
        from rig.closed_loop.confirm import fit_confirmed  # noqa: PLC0415

        if leave_out:
            raise UsageError("--confirmed-by keeps every row: leave --leave-out away")
        fitted = fit_confirmed(data, confirmed_by, options)
    else:
        fitted = kind.fit(
            FileSource(data), options, leave_out=leave_out or (), own=laboratory_effects(), keep=out_file is not None
        )
    result = fitted.to_json()
    if report is not None:
        page = fitted.page()
        if page is None:
            raise UsageError(f"--report: a fit of {kind.title} has none; rig trace {data} --report writes one")
        _write_report(report, page)
    if out_file is not None:
        write_whole(out_file, lambda file: json.dump(result, file, indent=2, allow_nan=False))
        err.print(f"calibration: {escape(str(out_file))}", soft_wrap=True)
    if as_json:
        print_json(result)
    else:
        show(fitted.blocks(), out)
    show_unused(result["unused"])
    return ExitCode.DONE


@app.command()
@with_options_of_kinds(lambda kind: kind.trace_options)
def trace(
    data: DataArgument,
    as_json: JsonOption = False,
    report: Annotated[Path | None, typer.Option(help="write a self-contained HTML report", show_default=False)] = None,
    *,
    given: dict[str, Any],
) -> int:
    """Find what the declared model lacks: residual, effect, error before and after.

    Examples: `rig trace runs/20260115T180000-night-1a2b.sqlite --report night.html`,
    `rig trace table.csv --response y --formula "1 + x" --group batch --time t_s`
    """
    from rig.effects import laboratory_effects  # noqa: PLC0415
    from rig.tables import FileSource  # noqa: PLC0415

    check_files([report], [data])
    source = FileSource(data)
    kind, options = chosen(source, given, lambda one: one.trace_options)
    traced = kind.trace(source, options, own=laboratory_effects())
    if report is not None:
        _write_report(report, traced.page())
    result = traced.to_json()
    if as_json:
        print_json(result)
    else:
        _show_trace(kind, traced)
    show_unused(result["unused"])
    return ExitCode.DONE


def _show_trace(kind: Kind, traced: Traced) -> None:
    """Show what was found, and how to confirm it where a run can be made."""
    show(traced.blocks(), out)
    found = any(finding.kind == "effect" for outcome in traced.outcomes for finding in outcome.findings)
    if found and "run_id" in traced.table.provenance and kind.confirming(traced) is not None:
        out.print(
            f"\nto confirm what was found by a further run: rig confirm {escape(traced.table.source)} --list",
            soft_wrap=True,
        )


def _write_report(path: Path, page: Page) -> None:
    from rig.report import write_page  # noqa: PLC0415

    write_page(path, page)
    err.print(f"report: {escape(str(path))}", soft_wrap=True)
