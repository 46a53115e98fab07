"""`rig chart`: several calibrations of one sensor."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rig.atomic import check_files
from rig.cli import app
from rig.cli.run import JsonOption
from rig.cli.show import show_result, write_report
from rig.errors import ExitCode


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
            min=0.1,
            max=180,
            help="range they are used in, +- deg, for kinds that know one",
            show_default="as calibrated last",
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
    from rig.closed_loop.chart_inputs import path_of  # noqa: PLC0415
    from rig.results.charts import chart as chart_files  # noqa: PLC0415

    check_files([report], [path_of(source) for source in calibrations])
    charted = chart_files(
        calibrations, tolerance=tolerance, usage=usage, sensors=sensor or (), formula=formula, today=today
    )
    write_report(charted, report)
    show_result(charted, as_json=as_json)
    return ExitCode.DONE
