"""`rig chart`: several calibrations of one sensor."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.markup import escape
from rich.table import Table as RichTable

from rig.atomic import check_files
from rig.cli import app
from rig.cli.run import JsonOption
from rig.cli.show import err, mark, out, print_json
from rig.errors import ExitCode, UsageError

if TYPE_CHECKING:
    from procedures.charting import View


@app.command()
def chart(
    calibrations: Annotated[
        list[str],
        typer.Argument(
            help="run files, calibration files of `rig fit --out`, or CSV tables; where they do not tell their date, "
            "with it: table.csv@2026-01-15",
            show_default=False,
        ),
    ],
    tolerance: Annotated[
        float | None,
        typer.Option(
            min=1e-9,
            help="error of the output that the last calibration may come to have: deg, psi, or as the response",
            show_default="95 % interval of one reading",
        ),
    ] = None,
    usage: Annotated[
        float | None,
        typer.Option(
            min=0.1, max=180, help="attitude: pitch they are used in, +- deg", show_default="as calibrated last"
        ),
    ] = None,
    sensor: Annotated[
        list[str] | None, typer.Option(help="chart only this sensor, such as x_V; repeatable", show_default=False)
    ] = None,
    formula: Annotated[
        str | None,
        typer.Option(
            "--formula",
            help="whole plots: the model, where not the one declared",
            show_default=False,
        ),
    ] = None,
    report: Annotated[Path | None, typer.Option(help="write a self-contained HTML report", show_default=False)] = None,
    as_json: JsonOption = False,
    today: Annotated[str | None, typer.Option(help="date that 'in N days' counts from", show_default="today")] = None,
) -> int:
    """Chart the parameters of sensors over several calibrations: is one drifting, and when is it due again?

    Two calibrations are compared; three give a trend and a due date, four can show a step. The errors are those
    between the replications of each calibration. The due date is the last day on which the last calibration's output
    is within the tolerance, with 95 % probability, everywhere in the range of use.

    Example: `rig chart runs/2026*.sqlite --tolerance 5e-4 --usage 30 --report chart.html`
    """
    from rig.closed_loop.chart import chart_calibrations  # noqa: PLC0415
    from rig.closed_loop.chart_inputs import path_of  # noqa: PLC0415
    from rig.closed_loop.chart_together import read_together  # noqa: PLC0415

    check_files([report], [path_of(source) for source in calibrations])
    given, left_out = read_together(calibrations, formula, sensor or ())
    charted = chart_calibrations(
        given, _today(today), sensors=sensor or (), tolerance=tolerance, usage_deg=usage, left_out=left_out
    )
    if report is not None:
        from rig.report import write_page  # noqa: PLC0415
        from rig.report.chart import chart_page  # noqa: PLC0415

        write_page(report, chart_page(charted))
        err.print(f"report: {escape(str(report))}", soft_wrap=True)
    result = charted.to_json()
    if as_json:
        print_json(result)
        return ExitCode.DONE
    first, last = charted.given[0].date, charted.given[-1].date
    out.print(f"{mark(charted.simulated)}[bold]{len(charted.given)} calibrations[/] from {first} to {last}")
    for name, found in result["sensors"].items():
        _show_sensor(name, charted.sensors[name].view, found)
    for note in charted.notes:
        out.print(f"  [yellow]{escape(note)}[/]", soft_wrap=True)
    return ExitCode.DONE


def _today(given: str | None) -> datetime:
    if given is None:
        from drivers.clock import RealClock  # noqa: PLC0415

        return datetime.fromtimestamp(RealClock().utc(), UTC)
    try:
        moment = datetime.fromisoformat(given)
    except ValueError:
        raise UsageError(f"--today: {given!r} is no date; write 2026-01-15") from None
    return moment.replace(tzinfo=UTC) if moment.tzinfo is None else moment.astimezone(UTC)


def _show_sensor(name: str, view: View, found: Mapping[str, Any]) -> None:
    from procedures.numbers import with_error  # noqa: PLC0415
    from rig.closed_loop.chart_words import due_date  # noqa: PLC0415

    rows = found["calibrations"]
    table = RichTable("date", *rows[0]["parameters"], "outside", title=f"\n{name}, {found['model']}")
    table.title_justify = "left"
    cells = [[with_error(v["estimate"], v["stderr"]) for v in row["parameters"].values()] for row in rows]
    alike = all([error for _, error in each] == [error for _, error in cells[0]] for each in cells)
    for row, each in zip(rows, cells, strict=True):
        outside = ", ".join(f"{view.shown[q].label} {limit}" for q, limit in row["outside"].items())
        values = [value if alike else f"{value} +- {error}" for value, error in each]
        table.add_row(row["date"], *values, f"[yellow]{outside}[/]" if outside else "")
    if alike:
        table.add_row("std. error", *(error for _, error in cells[0]), style="dim")
    out.print(table)
    if not alike:
        out.print("  values +- one standard error")
    for sentence in found["sentences"]:
        out.print(f"  {escape(sentence)}", soft_wrap=True)
    if found["due"]["status"] == "too few":
        return
    table = RichTable(f"tolerance / {found['due']['unit']}", "due", "if calibrations scatter", "if the sensor wanders")
    for due in found["due_by_tolerance"]:
        table.add_row(f"{due['tolerance']:.2g}", due_date(due), *(v or "-" for v in due["by_variation"].values()))
    out.print(table)
    out.print(f"  (95 % probability, {view.usage_words}; the earlier of both)")
