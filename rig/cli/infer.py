"""`rig infer`: a calibration in use."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer
from rich.markup import escape

from rig.cli import app
from rig.cli.kind_options import with_options_of_kinds
from rig.cli.run import JsonOption
from rig.cli.show import err, mark, print_json, show_notes
from rig.errors import ExitCode


@app.command()
@with_options_of_kinds(lambda kind: kind.infer_options)
def infer(
    calibration: Annotated[Path, typer.Argument(help="what `rig fit --out` wrote", show_default=False)],
    data: Annotated[
        Path,
        typer.Argument(
            help="CSV with the outputs; pressure: and sensor_temperature_degC, sse_temperature_degC, and a column "
            "`vacuum`, 1 for rows read at zero pressure",
            show_default=False,
        ),
    ],
    out_file: Annotated[Path, typer.Option("--out", "-o", help="the CSV file to write", show_default=False)],
    as_json: JsonOption = False,
    *,
    given: dict[str, Any],
) -> int:
    """Infer pitch and roll, pressure, or the abscissa of a curve from outputs, with 95 % intervals.

    Attitude: the columns of the calibrated sensors (x_V, y_V, z_V), and the sensor temperature where the calibration
    has it in. A single sensor needs roll that was measured otherwise. Where an angle is undetermined it is left open,
    with the reason in `flag`.

    Pressure: the transducer's output and both temperatures. Reading the zero in vacuum first (in flight, before entry)
    takes out the error that a change of temperature draws again; its own error is in the interval. Intervals hold as
    long as the temperatures have stood since the zero was read: rows at other temperatures are flagged. Values outside
    the calibrated range are flagged, not extrapolated. The zero is compared with the calibration: one that is hard to
    believe is flagged in every row. Several zero rows are of one sitting or independent: --zero-rows says which.

    Any table: the response's column; the fitted curve is inverted where it rises or falls all the way.

    A row that lacks a value gets an empty result and a flag; columns and rows that are not used are named.

    Some packages have two attitudes for the same outputs; rows where --near decided are marked in a column `assumed`.

    Examples: `rig infer calibration.json flight.csv --zero vacuum.csv --out pressures.csv`,
    `rig infer package.json wind-tunnel.csv --out angles.csv`,
    `rig infer package.json upside-down.csv --near 0 180 --out angles.csv`,
    `rig infer package.json x-only.csv --sensors x_V --roll roll_deg --roll-sd 0.05 --out pitch.csv`
    """
    from rig.api.inferred import infer as infer_readings  # noqa: PLC0415

    found = infer_readings(calibration, data, out=out_file, **given)
    show_notes(found)
    err.print(f"{mark(found.simulated)}{escape(str(out_file))}: {found.words}", soft_wrap=True)
    if as_json:
        print_json(found.to_json())
    return ExitCode.DONE
