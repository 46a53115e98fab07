"""`rig infer`: a calibration in use."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer
from rich.markup import escape

from rig.cli.budget_options import SameMeterOption
from rig.cli.commands import app
from rig.cli.kind_options import with_options_of_kinds
from rig.cli.options import JsonOption
from rig.cli.show import err, mark, print_json, show_notes
from rig.cli.table_options import DecimalOption, EncodingOption, HeaderOption, SeparatorOption
from rig.errors import ExitCode


@app.command()
@with_options_of_kinds(lambda kind: kind.infer_options, lambda kind: kind.in_use)
def infer(
    calibration: Annotated[Path, typer.Argument(help="calibration file of `rig fit --out`", show_default=False)],
    data: Annotated[Path, typer.Argument(help="CSV with the outputs", show_default=False)],
    out_file: Annotated[Path, typer.Option("--out", "-o", help="the CSV file to write", show_default=False)],
    same_meter: SameMeterOption = False,
    readings: Annotated[
        int | None,
        typer.Option(
            help="number of readings of which each row is the mean",
            show_default="as many as a point of the run had",
        ),
    ] = None,
    as_json: JsonOption = False,
    separator: SeparatorOption = None,
    decimal: DecimalOption = None,
    encoding: EncodingOption = None,
    header: HeaderOption = None,
    *,
    given: dict[str, Any],
) -> int:
    """Infer the measured quantity from outputs by a calibration, with 95 % intervals.

    The table has the columns of the calibrated outputs, and other columns that the calibration needs. A row with a
    missing value gets an empty result and a flag; unused columns and rows are named.

    Examples:

    - `rig infer calibration.json readings.csv --out inferred.csv`
    - `rig infer calibration.json readings.csv --out inferred.csv --readings 5 --same-meter`
    - `rig infer thermistor.json readings.csv --out inferred.csv --quantity bath_degC --between 0 60`
    """
    from rig.verbs.infer.result import infer as infer_readings  # noqa: PLC0415

    how: dict[str, Any] = {"separator": separator, "decimal": decimal, "encoding": encoding, "header": header}
    found = infer_readings(calibration, data, out=out_file, same_meter=same_meter, mean_of=readings, **how, **given)
    show_notes(found)
    err.print(f"{mark(found.simulated)}{escape(str(out_file))}: {found.words}", soft_wrap=True)
    if as_json:
        print_json(found.to_json())
    return ExitCode.DONE
