"""`rig infer`: a calibration in use."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer
from rich.markup import escape

from rig.atomic import check_files
from rig.cli import app
from rig.cli.kind_options import options_of, with_options_of_kinds
from rig.cli.run import JsonOption
from rig.cli.show import err, mark, print_json, show_unused
from rig.errors import ExitCode


@app.command()
@with_options_of_kinds(lambda kind: kind.infer_options, lambda kind: kind.in_use)
def infer(
    calibration: Annotated[Path, typer.Argument(help="what `rig fit --out` wrote", show_default=False)],
    data: Annotated[Path, typer.Argument(help="CSV with the outputs", show_default=False)],
    out_file: Annotated[Path, typer.Option("--out", "-o", help="the CSV file to write", show_default=False)],
    as_json: JsonOption = False,
    *,
    given: dict[str, Any],
) -> int:
    """Infer from outputs what their sensors were calibrated for, with 95 % intervals.

    The table has the columns of the calibrated outputs, and what else the calibration needs. A row that lacks a value
    gets an empty result and a flag; columns and rows that are not used are named.

    Example: `rig infer calibration.json readings.csv --out inferred.csv`
    """
    from rig import inference  # noqa: PLC0415
    from rig.tables.csv_tables import write_csv  # noqa: PLC0415

    named = [value for value in given.values() if isinstance(value, Path)]
    check_files([out_file], [calibration, data, *named])
    file = inference.read_calibration(calibration)
    options = options_of(file.kind, given, lambda kind: kind.infer_options, f"this calibration is of {file.kind.title}")
    found = inference.infer(file, data, options)
    write_csv(found.columns, out_file)
    for note in found.notes:
        err.print(f"[yellow]{escape(note)}[/]", soft_wrap=True)
    show_unused(found.unused.to_json())
    rows = len(next(iter(found.columns.values())))
    what = f"{rows} rows, {found.flagged} flagged; {', '.join(found.quantities)} with _sd, _lo95, _hi95 and flag"
    err.print(f"{mark(file.simulated)}{escape(str(out_file))}: {what}", soft_wrap=True)
    if as_json:
        print_json({"file": str(out_file), "simulated": file.simulated, **found.to_json()})
    return ExitCode.DONE
