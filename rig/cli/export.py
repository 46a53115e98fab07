"""`rig export`: the observations of a run as a table, CSV or Parquet.

Its columns are made by `rig.tables.table_of_run`, those of the table of faults by `rig.tables.faults`.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from rig.cli.commands import app
from rig.cli.show import err, headline
from rig.errors import ExitCode
from rig.files.atomic import check_ending, check_files


@app.command()
def export(
    run_file: Annotated[Path, typer.Argument(help="the run file", show_default=False)],
    out_file: Annotated[
        Path,
        typer.Option(
            "--out",
            "-o",
            help="the file to write: CSV, or Parquet for a name that ends in .parquet",
            show_default=False,
        ),
    ],
    everything: Annotated[
        bool,
        typer.Option("--all", help="include rejected observations; faults and decisions go to a second file"),
    ] = False,
    salvage: Annotated[
        bool, typer.Option("--salvage", help="export readable parts of a damaged or edited file, unverified")
    ] = False,
) -> int:
    """Write a run's observations as CSV or Parquet, units in the column names.

    Columns x_sd_V, readings and flag_noisy, for example, say how the readings of each point scatter, how many there
    are, and which flags it has.

    Examples:

    - `rig export runs/20260115T180000-night-1a2b.sqlite --out night.csv`
    - `rig export RUN --all --out night.parquet`
    - `rig export DAMAGED --salvage --out saved.csv`
    """
    from rig.tables.csv_files import write_csv  # noqa: PLC0415
    from rig.tables.faults import check_replaceable, faults, write_faults  # noqa: PLC0415
    from rig.tables.parquet_files import check_parquet, write_parquet  # noqa: PLC0415
    from rig.tables.table_of_run import run_table  # noqa: PLC0415

    beside = out_file.with_name(f"{out_file.stem}.faults.csv") if everything and not salvage else None
    check_files([out_file, beside], [run_file])
    check_ending(out_file, ".csv", ".parquet")
    as_parquet = out_file.suffix.lower() == ".parquet"
    if as_parquet:
        check_parquet()
    if beside is not None:
        check_replaceable(beside)
    table = run_table(run_file, everything=everything, salvage=salvage, evidence=True)
    rows = [] if beside is None else faults(run_file)
    if salvage:
        err.print("[bold yellow]NOT VERIFIED:[/] the hash chain does not prove these values; see `rig verify`")
    if everything:
        seen = int(table.columns["accepted"].sum())
        table = replace(table, provenance={**table.provenance, "points_observed": seen})
    if as_parquet:
        write_parquet(table, out_file, verified=not salvage)
    else:
        write_csv(table.columns, out_file)
    headline(str(out_file), table, err)
    if rejected := table.provenance.get("observations_rejected"):
        err.print(f"[yellow]{rejected} rejected observations are omitted; --all includes them[/]")
    if beside is not None:
        write_faults(rows, beside)
        err.print(f"{escape(str(beside))}: {len(rows)} faults, decisions and their results", soft_wrap=True)
    return ExitCode.DONE
