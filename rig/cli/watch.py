"""`rig watch`: the live page of a run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rig.cli.commands import app
from rig.errors import ExitCode, UsageError


@app.command()
def watch(
    where: Annotated[Path, typer.Argument(help="the run file, or a folder of run files", show_default=False)],
    port: Annotated[int, typer.Option(min=0, max=65535, help="TCP port; 0 for any free port")] = 8321,
    host: Annotated[str, typer.Option(help="address to listen on; other than this machine's own needs a token")] = (
        "127.0.0.1"
    ),
    token: Annotated[
        str | None, typer.Option(help="token for visitors; generated and printed if needed", show_default=False)
    ] = None,
    against: Annotated[
        Path | None,
        typer.Option(help="show residuals against this calibration file or earlier run", show_default=False),
    ] = None,
) -> int:
    """Serve a live page of a run: state, remaining time, readings, residuals, warnings.

    It reads the run file and the controller's status file beside it, writes nothing, and needs no internet. The first
    line printed is the address to open. Ends with Ctrl-C.

    Examples:

    - `rig watch runs/`
    - `rig watch RUN --port 8090`
    - `rig watch RUN --against EARLIER_RUN`
    """
    if token is not None and len(token) < _SHORTEST:
        raise UsageError(f"--token: {len(token)} characters are too easily guessed; {_SHORTEST} at least, or leave it")
    if token is not None and not (token.isascii() and token.isprintable()):
        raise UsageError("--token: it becomes part of an address and a header: plain ASCII characters only")
    from rig.drivers.clock import RealClock  # noqa: PLC0415
    from rig.watch.server import serve  # noqa: PLC0415 - the web server is slow to import

    clock = RealClock()
    serve(
        where,
        host=host,
        port=port,
        token=token,
        against=against,
        stopwatch=clock.stopwatch,
        utc=clock.utc,
        announce=lambda text: print(text, flush=True),
    )
    return ExitCode.DONE


_SHORTEST = 8
