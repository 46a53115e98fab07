"""The command `rig status` and its options; `rig.results.status` prints a run, `runs` a folder."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rig.cli import app
from rig.cli.run import JsonOption
from rig.cli.runs import check_code, list_runs
from rig.cli.show import out, print_json
from rig.errors import ExitCode
from rig.present.terminal import show
from rig.results.status import status_of


@app.command()
def status(
    run_file: Annotated[Path, typer.Argument(help="a run file, or a folder of them", show_default=False)] = Path(
        "runs"
    ),
    as_json: JsonOption = False,
    check: Annotated[
        bool, typer.Option("--check", help="use the exit code for the state: see docs/exit-codes.md")
    ] = False,
) -> int:
    """Show the state of a run, running or not; for a folder, its runs, newest first.

    A complete run is fitted and compared with its procedure's acceptance limits, as at its end.

    With --check the exit code is 0 if the run is complete, 6 if it is running, 4 if it was stopped, 1 if it ended by a
    fault, 75 if it was interrupted or never begun. An edited or damaged file gives 1 in any case.

    Examples: `rig status runs/ID.sqlite`, `rig status runs`, `rig status RUN --check && rig fit RUN`
    """
    if run_file.is_dir():
        return list_runs(run_file, as_json=as_json, check=check)
    found = status_of(run_file)
    if as_json:
        print_json(found.to_json())
    else:
        show(found.blocks(), out)
    return ExitCode.FAULT if found.broken else check_code(found.state, run_file) if check else ExitCode.DONE
