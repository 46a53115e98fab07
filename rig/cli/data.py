"""`rig fit`, `rig trace`: analysis of data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.markup import escape

from rig.cli.budget_options import EquipmentOption
from rig.cli.commands import app
from rig.cli.kind_options import with_options_of_kinds
from rig.cli.options import JsonOption
from rig.cli.show import err, out, print_json, show_notes, show_result, write_report
from rig.cli.table_options import DecimalOption, EncodingOption, HeaderOption, SeparatorOption
from rig.cli.waiting import waiting
from rig.errors import ExitCode, UsageError
from rig.files.atomic import check_files, check_format
from rig.procedures.evaluate.in_short import in_short
from rig.procedures.evaluate.results import Traced
from rig.procedures.kind import Kind
from rig.procedures.present.shell import confirming
from rig.procedures.present.terminal import show

if TYPE_CHECKING:
    from rig.tables import FileForm, FileSource

DataArgument = Annotated[Path, typer.Argument(help="a run file, or a CSV table", show_default=False)]


@app.command()
@with_options_of_kinds(lambda kind: kind.fit_options)
def fit(
    data: DataArgument,
    full: Annotated[bool, typer.Option("--full", help="every number of each sensor, not one screen")] = False,
    as_json: JsonOption = False,
    out_file: Annotated[
        Path | None, typer.Option("--out", "-o", help="write the calibration to this JSON file", show_default=False)
    ] = None,
    report: Annotated[
        Path | None, typer.Option(help="write tables and plots as HTML, for kinds that have them", show_default=False)
    ] = None,
    leave_out: Annotated[
        list[str] | None,
        typer.Option(
            "--leave-out",
            help="fit without these rows, with a note in the calibration: 'gross' for the gross errors found, or row "
            "numbers of the file (12,31); repeatable",
            show_default="all rows are fitted, and gross errors are reported",
        ),
    ] = None,
    confirmed_by: Annotated[
        list[Path] | None,
        typer.Option(
            "--confirmed-by",
            help="write the calibration with the causes confirmed by this later run file (see rig confirm); repeatable",
            show_default=False,
        ),
    ] = None,
    added: Annotated[
        list[Path] | None,
        typer.Option(
            help="a run that is evaluated with this one as one run, as a loop adds it; repeatable, in their order",
            show_default=False,
        ),
    ] = None,
    equipment: EquipmentOption = None,
    separator: SeparatorOption = None,
    decimal: DecimalOption = None,
    encoding: EncodingOption = None,
    header: HeaderOption = None,
    *,
    given: dict[str, Any],
) -> int:
    """Fit the declared model to every sensor; analyse replications, or whole plots by all methods.

    More than three sensors take one screen; `--full` has every number.

    Examples:

    - `rig fit runs/20260115T180000-night-1a2b.sqlite`
    - `rig fit RUN --traced --temperature --out package.json`
    - `rig fit RUN --points 73`
    - `rig fit table.csv --response y --formula "1 + x"`
    """
    from rig.tables import FileForm, FileSource  # noqa: PLC0415
    from rig.verbs.data.result import fit_source  # noqa: PLC0415
    from rig.verbs.data.result import in_short as in_short_of  # noqa: PLC0415

    more = [*(confirmed_by or ()), *(added or ())]
    check_files([out_file, report], [data, *more, *filter(None, (equipment,))])
    check_format(out_file, ".json")
    check_format(report, ".html", ".htm")
    source = FileSource(data, FileForm.of(separator, decimal, encoding, header))
    if not leave_out and not more and _seen(source, "fit", given, as_json=as_json):
        return ExitCode.USAGE
    with waiting("fitting"):
        fitted = fit_source(
            source,
            given,
            leave_out or (),
            confirmed_by or (),
            keep=out_file is not None,
            equipment=equipment,
            added=added or (),
        )
    write_report(fitted, report)
    if out_file is not None:
        fitted.save(out_file)
        err.print(f"calibration: {escape(str(out_file))}", soft_wrap=True)
    blocks = [*(fitted.blocks() if full or as_json else in_short_of(fitted))]
    show_result(fitted, as_json=as_json, blocks=blocks)
    if not full and not as_json and len(blocks) < len([*fitted.blocks()]):
        out.print("\nmore: --full; the methods and coefficients of each sensor are in --json, too")
    return ExitCode.DONE if fitted.inside else ExitCode.OUTSIDE_ACCEPTANCE


@app.command()
@with_options_of_kinds(lambda kind: kind.trace_options)
def trace(
    data: Annotated[
        list[Path], typer.Argument(help="a run file, or a CSV table; several runs of one bench", show_default=False)
    ],
    full: Annotated[bool, typer.Option("--full", help="every number and sentence, not one screen")] = False,
    as_json: JsonOption = False,
    report: Annotated[Path | None, typer.Option(help="write a self-contained HTML report", show_default=False)] = None,
    separator: SeparatorOption = None,
    decimal: DecimalOption = None,
    encoding: EncodingOption = None,
    header: HeaderOption = None,
    *,
    given: dict[str, Any],
) -> int:
    """Find effects missing in the declared model: residual, effect, error before and after.

    Of several runs of one bench each is traced, and held against the others: what comes back is of the bench or of the
    sensors, what does not is of its run.

    Examples:

    - `rig trace runs/20260115T180000-night-1a2b.sqlite --report night.html`
    - `rig trace table.csv --response y --formula "1 + x" --group batch --time t_s`
    - `rig trace RUN LATER_RUN`
    """
    from rig.tables import FileForm, FileSource  # noqa: PLC0415
    from rig.verbs.data.result import trace_source  # noqa: PLC0415

    check_files([report], data)
    check_format(report, ".html", ".htm")
    form = FileForm.of(separator, decimal, encoding, header)
    if len(data) > 1:
        return _several(data, given, report, form, as_json=as_json)
    source = FileSource(data[0], form)
    if _seen(source, "trace", given, as_json=as_json):
        return ExitCode.USAGE
    with waiting("tracing"):
        found = trace_source(source, given)
    write_report(found, report)
    if as_json:
        show_result(found, as_json=True)
    else:
        _show_trace(found.kind, found.traced, given.get("ignore"), full=full)
        show_notes(found)
    return ExitCode.DONE


def _several(
    paths: Sequence[Path], given: Mapping[str, Any], report: Path | None, form: FileForm, *, as_json: bool
) -> int:
    """Trace runs of one bench, and say what comes back."""
    from rig.tables import FileForm  # noqa: PLC0415
    from rig.verbs.confirm.several import several  # noqa: PLC0415

    if report is not None or form != FileForm():
        raise UsageError("--report and the form of a table are for one file: give the run files alone")
    found = several(paths, given)
    if as_json:
        print_json(found.to_json())
    else:
        show(found.blocks(), out)
    return ExitCode.DONE


def _seen(source: FileSource, command: str, given: dict[str, Any], *, as_json: bool) -> bool:
    """Say what is in a table that nobody has described; False for any other."""
    from rig.verbs.data.unknown_table import look_at  # noqa: PLC0415

    found = look_at(source, command, {name: value for name, value in given.items() if value is not None})
    if found is None:
        return False
    if found.table.understood:
        err.print(f"[yellow]{escape(found.table.understood['sentence'])}[/]", soft_wrap=True)
    if as_json:
        print_json(found.to_json())
    else:
        show(found.blocks(), out)
    return True


def _show_trace(kind: Kind, traced: Traced, ignore: Sequence[str] | None, *, full: bool) -> None:
    """Show the findings, and how to confirm them if a run can be made."""
    show(traced.blocks() if full else in_short(traced), out)
    if not full:
        out.print("\nmore: --full; with plots: --report FILE.html")
    found = any(finding.kind == "effect" for outcome in traced.outcomes for finding in outcome.findings)
    if found and "run_id" in traced.table.provenance and kind.confirming(traced) is not None:
        out.print(
            f"\nto confirm these effects by a further run: {escape(confirming(traced.table.source, ignore))} --list",
            soft_wrap=True,
        )
