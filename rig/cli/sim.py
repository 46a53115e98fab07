"""`rig sim`: the simulated bench in a process of its own, behind real serial ports, sockets and CAN."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rig.cli import app
from rig.cli.show import err
from rig.errors import ExitCode


@app.command()
def sim(
    bench: Annotated[Path, typer.Argument(help="the bench file", show_default=False)],
    world: Annotated[Path | None, typer.Option(help="the truth behind the simulated bench", show_default=False)] = None,
    speed: Annotated[float, typer.Option(min=0.01, max=10_000, help="bench seconds per real second")] = 1.0,
    live: Annotated[Path, typer.Option(help="where to write the bench file with the addresses served")] = Path(
        "LIVE.toml"
    ),
    seconds: Annotated[
        float | None,
        typer.Option("--for", min=0.1, help="stop by itself after so many real seconds", show_default=False),
    ] = None,
    tape: Annotated[
        Path | None,
        typer.Option(help="add every answer, and what truly happens, to this file, a JSON object a line"),
    ] = None,
) -> int:
    """Serve a simulated bench to other programs: pseudo-terminals, a local TCP port, slcan.

    The same instruments as in `rig run --dry`, but behind the operating system's own serial ports and sockets.
    Use the bench file it writes with `rig run procedure.toml --bench LIVE.toml`. Ends with Ctrl-C;
    SIGUSR1 is a power cut: every instrument restarts, with what it forgets when it does.

    Example: `rig sim bench.toml --world world.toml --speed 100`
    """
    from rig.simulated.served import serve_bench  # noqa: PLC0415

    serve_bench(bench, world, speed, live, seconds, tape, announce=err.print)
    return ExitCode.DONE
