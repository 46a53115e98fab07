"""`rig hold`, `release`, `stop`, `done`: requests to a running controller."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer
from rich.markup import escape

from rig.cli.commands import app
from rig.cli.options import OperatorOption, RunArgument
from rig.cli.show import err
from rig.cli.signed_in import LoginOption, acting
from rig.errors import ExitCode
from rig.run_file.live import asked_by_hand, live_path, read_json
from rig.run_file.verify.verification import LOOP_SUFFIX
from rig.verbs.run.requests import ask


def _asked(run_file: Path, verb: str, **more: Any) -> int:
    if run_file.is_file() and run_file.name.endswith(LOOP_SUFFIX):
        from rig.loop import run_at_work  # noqa: PLC0415 - few files are loops

        run_file = run_at_work(run_file)
    err.print(escape(ask(run_file, verb, **more)), soft_wrap=True)
    return ExitCode.DONE


@app.command()
def hold(run_file: RunArgument, login: LoginOption = None) -> int:
    """Stop all motion, leave chambers as they are, and wait; `rig release` continues the run.

    Examples:

    - `rig hold runs/20260115T180000-night-1a2b.sqlite`
    - `rig hold runs/NAME.loop.sqlite`
    - `rig hold RUN --login anna`
    """
    return _asked(run_file, "hold", who=acting(run_file, login, refuses=False).name)


@app.command()
def release(run_file: RunArgument, login: LoginOption = None) -> int:
    """Continue a held run.

    Examples:

    - `rig release runs/20260115T180000-night-1a2b.sqlite`
    - `rig release runs/NAME.loop.sqlite`
    - `rig release RUN --login anna`
    """
    return _asked(run_file, "release", who=acting(run_file, login, refuses=False).name)


@app.command()
def done(
    run_file: RunArgument,
    value: Annotated[
        str | None,
        typer.Option(help="the number that the step asks for, in the unit of its name", show_default=False),
    ] = None,
    operator_name: OperatorOption = None,
    login: LoginOption = None,
) -> int:
    """Say that a step by hand is done; the run goes on.

    The run says what it waits for: on the terminal, in `rig status`, on its page and in its message.

    Examples:

    - `rig done runs/20260115T180000-night-1a2b.sqlite`
    - `rig done RUN --value 5.0003`
    - `rig done RUN --value 5.0003 --operator Anna`
    """
    by = acting(run_file, login, operator_name)
    asked = asked_by_hand(read_json(live_path(run_file)) or {}) if run_file.is_file() else None
    step = 0 if asked is None else asked.step
    if asked is not None:
        which = f"step {step} of {asked.of}: " if asked.of else ""
        err.print(f"{which}{escape(asked.say)}", soft_wrap=True)
    return _asked(run_file, "done", step=step, value=value, who=by.name)


@app.command()
def stop(run_file: RunArgument, login: LoginOption = None) -> int:
    """Park the bench and end the session; the run can be resumed later.

    Examples:

    - `rig stop runs/20260115T180000-night-1a2b.sqlite`
    - `rig stop runs/NAME.loop.sqlite`
    - `rig stop RUN --login anna`
    """
    return _asked(run_file, "stop", who=acting(run_file, login, refuses=False).name)
