"""`rig sim`: the simulated bench in a separate process, behind real serial ports, sockets and CAN."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rig.cli.commands import app
from rig.cli.show import err
from rig.errors import ExitCode


@app.command()
def sim(
    bench: Annotated[Path, typer.Argument(help="the bench file", show_default=False)],
    world: Annotated[Path | None, typer.Option(help="world file of the simulated bench", show_default=False)] = None,
    speed: Annotated[float, typer.Option(min=0.01, max=10_000, help="bench seconds per real second")] = 1.0,
    live: Annotated[Path, typer.Option(help="bench file to write, with the served addresses")] = Path("LIVE.toml"),
    seconds: Annotated[
        float | None,
        typer.Option("--for", min=0.1, help="stop after this many real seconds", show_default=False),
    ] = None,
    tape: Annotated[
        Path | None,
        typer.Option(help="append all answers and true events to this file, one JSON object per line"),
    ] = None,
) -> int:
    """Serve a simulated bench to other programs: pseudo-terminals, local TCP ports, slcan.

    The same instruments as in `rig run --dry`, but behind serial ports and sockets of the operating system. Use the
    written bench file with `rig run procedure.toml --bench LIVE.toml`. Ends with Ctrl-C; SIGUSR1 is a power cut: every
    instrument restarts and loses its volatile state.

    Examples:

    - `rig sim bench.toml`
    - `rig sim bench.toml --world world.toml --speed 100`
    - `rig sim bench.toml --for 600 --tape answers.jsonl`
    """
    from rig.simulated.served import serve_bench  # noqa: PLC0415

    serve_bench(bench, world, speed, live, seconds, tape, announce=err.print)
    return ExitCode.DONE
