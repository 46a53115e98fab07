"""Arguments and options of several commands."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rig.who import VARIABLE

RunArgument = Annotated[Path, typer.Argument(help="the run file, DIR/ID.sqlite", show_default=False)]
BenchOption = Annotated[Path, typer.Option("--bench", "-b", help="the bench file", show_default=False)]
ProcedureArgument = Annotated[Path, typer.Argument(help="the procedure file", show_default=False)]
JsonOption = Annotated[bool, typer.Option("--json", help="print the result as JSON")]
OnlyOption = Annotated[str, typer.Option("--only", hidden=True, help="SHA-256 of what may run: of items of a queue")]
OperatorOption = Annotated[
    str | None,
    typer.Option(
        "--operator",
        help=f"operator of this session, for the run file; default: {VARIABLE}, or the login name",
        show_default=False,
    ),
]
DatabaseOption = Annotated[
    str,
    typer.Option(envvar="RIG_DATABASE", help="keep the index there, as postgresql://rig@db/lab", show_envvar=True),
]
