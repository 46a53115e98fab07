"""`rig hold`, `release`, `stop`, `done`: requests to a running controller."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.markup import escape

from rig.cli.commands import app
from rig.cli.options import OperatorOption, RunArgument
from rig.cli.show import err
from rig.errors import ExitCode, RigError, UsageError
from rig.procedures.present.shell import shell_word
from rig.run_file.live import asked_by_hand, controller_alive, live_path, read_json, send_request
from rig.run_file.read.reader import RunReader
from rig.run_file.state.state import read_state
from rig.run_file.verify.verification import LOOP_SUFFIX
from rig.who import operator


def _ask(run_file: Path, verb: str, **more: Any) -> int:
    if not run_file.is_file():
        raise UsageError(f"there is no run file {run_file}")
    if run_file.name.endswith(LOOP_SUFFIX):
        run_file = _run_of_loop(run_file)
    from rig.drivers.clock import RealClock  # noqa: PLC0415

    clock = RealClock()
    give_up = clock.now() + 30.0
    request_id = ""
    while clock.now() < give_up:
        if not request_id:
            with contextlib.suppress(FileExistsError):
                posted = send_request(run_file, verb, **more)
                if posted is None and not controller_alive(run_file):
                    status = f"`rig status {shell_word(run_file)}` shows its state"
                    raise UsageError(f"no controller is running on {run_file}; {status}")
                request_id = posted or ""  # it runs, and its session is not known yet or unreadable
        live = read_json(live_path(run_file))
        if request_id and live is not None and live.get("acknowledged") == request_id:
            break
        if not controller_alive(run_file):
            return _ended(run_file, verb)
        clock.sleep(0.05)
    else:
        stands = f"it will {verb} at its next check" if request_id else f"it was not asked to {verb}"
        raise RigError(
            f"the controller of {run_file} did not acknowledge within 30 s ({stands}): an instrument keeps it "
            f"waiting, its disk is full, or it hangs; `rig status {shell_word(run_file)}`"
        )
    refused = (live or {}).get("refused")
    if isinstance(refused, str) and refused:
        raise UsageError(refused)
    err.print(f"{verb}: acknowledged")
    return ExitCode.DONE


def _run_of_loop(path: Path) -> Path:
    """The run at which a loop is. Raises `UsageError` between two runs."""
    from rig.loop import open_program  # noqa: PLC0415 - few files are loops

    program = open_program(path)
    run = program.open_run
    if run is None or not program.file_of(run).exists():
        raise UsageError(f"no run of {path} is at work; `rig status {shell_word(path)}` shows its state")
    return program.file_of(run)


def _ended(run_file: Path, verb: str) -> int:
    """Result if the controller ended before it acknowledged."""
    with RunReader.open(run_file) as reader:
        state = read_state(reader)
    how = state.ended or state.rested
    if verb == "stop" and how in ("stopped", "complete"):
        err.print(f"{verb}: the run is {how}")
        return ExitCode.DONE
    raise RigError(
        f"the controller ended before {verb}: the run is {how}; `rig status {shell_word(run_file)}` says more"
    )


@app.command()
def hold(run_file: RunArgument) -> int:
    """Stop all motion, leave chambers as they are, and wait; `rig release` continues the run."""
    return _ask(run_file, "hold", who=operator().name)


@app.command()
def release(run_file: RunArgument) -> int:
    """Continue a held run."""
    return _ask(run_file, "release", who=operator().name)


@app.command()
def done(
    run_file: RunArgument,
    value: Annotated[
        str | None,
        typer.Option(help="the number that the step asks for, in the unit of its name", show_default=False),
    ] = None,
    operator_name: OperatorOption = None,
) -> int:
    """Say that a step by hand is done; the run goes on.

    The run says what it waits for: on the terminal, in `rig status`, on its page and in its message.

    Example: `rig done runs/20260115T180000-night-1a2b.sqlite --value 5.0003`
    """
    asked = asked_by_hand(read_json(live_path(run_file)) or {}) if run_file.is_file() else None
    step = 0 if asked is None else asked.step
    if asked is not None:
        which = f"step {step} of {asked.of}: " if asked.of else ""
        err.print(f"{which}{escape(asked.say)}", soft_wrap=True)
    return _ask(run_file, "done", step=step, value=value, who=operator(operator_name).name)


@app.command()
def stop(run_file: RunArgument) -> int:
    """Park the bench and end the session; the run can be resumed later."""
    return _ask(run_file, "stop", who=operator().name)
