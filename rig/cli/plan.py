"""`rig plan`: forecast of a run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rig.cli.commands import app
from rig.cli.options import BenchOption, JsonOption, ProcedureArgument
from rig.cli.progress import run_progress
from rig.cli.show import show_result
from rig.errors import ExitCode, UsageError


@app.command()
def plan(
    procedure: ProcedureArgument,
    bench: BenchOption,
    out_dir: Annotated[Path, typer.Option("--out", "-o", help="folder of the run file")] = Path("runs"),
    as_json: JsonOption = False,
    compare: Annotated[
        list[Path] | None,
        typer.Option(
            help="compare with other procedures of its kind and recommend one; repeatable", show_default=False
        ),
    ] = None,
    usage: Annotated[
        float | None,
        typer.Option(
            min=0.1,
            max=180,
            help="range of use of the sensors, +- deg, for kinds that have one",
            show_default="that of the procedure",
        ),
    ] = None,
    world: Annotated[
        Path | None,
        typer.Option(help="plan a dry run in this world: its day, its time constants", show_default="a real run"),
    ] = None,
    plot: Annotated[
        Path | None, typer.Option(help="with --compare: a PNG of precision over the range of use", show_default=False)
    ] = None,
) -> int:
    """Forecast a run: number of points, time of its end, precision, and problems.

    The duration comes from a rehearsal of the first points on simulated instruments with the bench file's own speeds.

    Examples:

    - `rig plan night.toml -b bench.toml`
    - `rig plan night.toml -b bench.toml --json`
    - `rig plan night.toml --compare short.toml --usage 30 --plot precision.png -b bench.toml`
    """
    if plot is not None and not compare:
        raise UsageError("--plot shows designs side by side: it requires --compare")
    if compare and world is not None:
        raise UsageError("--world plans one dry run: leave out --compare")
    if compare:
        from rig.cli.compare import compare_files  # noqa: PLC0415

        compare_files([procedure, *compare], bench, usage, plot, as_json=as_json)
        return ExitCode.DONE
    from rig.verbs.plan.result import plan as plan_run  # noqa: PLC0415

    with run_progress(simulated=True) as progress:
        planned = plan_run(procedure, bench, out=out_dir, usage=usage, world=world, on_progress=progress)
    show_result(planned, as_json=as_json)
    return ExitCode.DONE
