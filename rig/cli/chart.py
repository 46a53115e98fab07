"""`rig chart`: several calibrations of one sensor."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rig.cli.commands import app
from rig.cli.options import JsonOption
from rig.cli.show import show_result, write_report
from rig.errors import ExitCode
from rig.files.atomic import check_files, check_format


@app.command()
def chart(
    calibrations: Annotated[
        list[str],
        typer.Argument(
            help="run files, calibration files of `rig fit --out`, or CSV tables; for a file without a date, "
            "add it: table.csv@2026-01-15",
            show_default=False,
        ),
    ],
    tolerance: Annotated[
        float | None,
        typer.Option(
            min=1e-9,
            help="maximum permitted error of the last calibration's output: deg, psi, or in the unit of the response",
            show_default="95 % interval of one reading",
        ),
    ] = None,
    usage: Annotated[
        float | None,
        typer.Option(
            min=0.1,
            max=180,
            help="range of use, +- deg, for kinds that have one",
            show_default="range of the last calibration",
        ),
    ] = None,
    sensor: Annotated[
        list[str] | None, typer.Option(help="chart only this sensor, such as x_V; repeatable", show_default=False)
    ] = None,
    formula: Annotated[
        str | None,
        typer.Option(
            "--formula",
            help="whole plots: the model, if not the declared one",
            show_default=False,
        ),
    ] = None,
    report: Annotated[Path | None, typer.Option(help="write a self-contained HTML report", show_default=False)] = None,
    as_drift: Annotated[
        bool, typer.Option("--as-drift", help="print the drift of the sensors as lines for equipment.toml, no chart")
    ] = False,
    as_json: JsonOption = False,
    today: Annotated[str | None, typer.Option(help="date for 'in N days'", show_default="today")] = None,
) -> int:
    """Chart the parameters of sensors over several calibrations: drift, and the next due date.

    Two calibrations are compared; three give a trend and a due date; four can show a step. Errors come from the
    differences between the replications of each calibration. The due date is the last day on which the last
    calibration's output is within the tolerance, with 95 % probability, everywhere in the range of use.

    Examples:

    - `rig chart runs/2026*.sqlite`
    - `rig chart runs/2026*.sqlite --tolerance 5e-4 --usage 30 --report chart.html`
    - `rig chart A.json B.json C.json --sensor x_V --as-drift`
    """
    from rig.verbs.chart.inputs import path_of  # noqa: PLC0415
    from rig.verbs.chart.result import chart as chart_files  # noqa: PLC0415

    check_files([report], [path_of(source) for source in calibrations])
    check_format(report, ".html", ".htm")
    charted = chart_files(
        calibrations, tolerance=tolerance, usage=usage, sensors=sensor or (), formula=formula, today=today
    )
    write_report(charted, report)
    if as_drift:
        print(charted.as_drift(), end="")
        return ExitCode.DONE
    show_result(charted, as_json=as_json)
    return ExitCode.DONE
