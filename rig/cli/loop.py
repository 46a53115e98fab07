"""`rig loop`: a run, further runs until what it found is confirmed, and the calibration, before morning."""

from __future__ import annotations

import contextlib
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.markup import escape

from rig.cli.commands import app
from rig.cli.options import JsonOption, OnlyOption, OperatorOption
from rig.cli.progress import run_progress
from rig.cli.show import err, mark, out, outlive_readers, print_json
from rig.cli.signals import KillOption, killing, signals
from rig.cli.unattended import (
    Listening,
    LogFormatOption,
    LogOption,
    NotifyFileOption,
    NotifyOption,
    add_default_log,
    heard,
    listening,
)
from rig.engine.session import Outcome
from rig.errors import ExitCode, RigError, UsageError
from rig.procedures.present.shell import shell_word
from rig.procedures.present.terminal import show
from rig.run_file.read.reader import RunReader
from rig.unattended import Listeners, RunFacts, ServiceManager
from rig.who import operator

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from rig.loop import Ending
    from rig.run_file.chain import Record
    from rig.runs.plans import Plan

_EXIT = {
    Outcome.STOPPED: ExitCode.STOPPED,
    Outcome.INTERRUPTED: ExitCode.INTERRUPTED,
    Outcome.FAULT: ExitCode.FAULT,
    Outcome.UNSAFE: ExitCode.UNSAFE,
}


@app.command()
def loop(
    procedure: Annotated[
        Path | None, typer.Argument(help="the procedure file of the first run", show_default=False)
    ] = None,
    bench: Annotated[Path | None, typer.Option("--bench", "-b", help="the bench file", show_default=False)] = None,
    until: Annotated[
        str | None, typer.Option(help="time of day by which all is done, as 07:00; local time", show_default=False)
    ] = None,
    hours: Annotated[
        float | None, typer.Option(min=0.01, help="the same as a number of hours", show_default=False)
    ] = None,
    continues: Annotated[
        Path | None,
        typer.Option(
            "--continue",
            help="go on with this closed loop, also with runs in which a person acts",
            show_default=False,
        ),
    ] = None,
    dry: Annotated[bool, typer.Option("--dry", help="replace the real instruments by simulated ones")] = False,
    world: Annotated[
        Path | None, typer.Option(help="with --dry: the world file of the simulated bench", show_default=False)
    ] = None,
    out_dir: Annotated[Path, typer.Option("--out", "-o", help="folder for all files")] = Path("runs"),
    operator_name: OperatorOption = None,
    log: LogOption = None,
    log_format: LogFormatOption = "text",
    notify: NotifyOption = None,
    notify_file: NotifyFileOption = None,
    kill_at_point: KillOption = None,
    only: OnlyOption = "",
    as_json: JsonOption = False,
) -> int:
    """Run a procedure, find and confirm what its model lacks by further runs, and calibrate, until a time.

    The first line printed is the program file's path, NAME.loop.sqlite: `rig resume` continues it after a crash. Bounds
    are in [loop] of the procedure. Exit code 0: nothing was found, or one explanation remains for every effect; 3:
    closed, and something is open, error is left, or a further run ended by a fault; others as of `rig run`.

    Examples:

    - `rig loop procedure.toml --bench bench.toml --until 07:00`
    - `rig loop procedure.toml --bench bench.toml --dry --world world.toml --hours 12`
    - `rig loop --continue FILE --hours 3`
    """
    from rig.loop import continue_loop, start_loop  # noqa: PLC0415

    outlive_readers()
    asked = Listening(log, log_format, notify, notify_file, dry=dry, strict=True)
    common: dict[str, Any] = {"until": until, "hours": hours}
    if continues is not None:
        if procedure is not None or bench is not None or world is not None or dry:
            raise UsageError("--continue has procedure, bench and world in the program file: give the file alone")
        return conducted(
            lambda how: continue_loop(continues, **common, **how),
            _of_file(asked, continues),
            operator_name,
            as_json=as_json,
        )
    if procedure is None or bench is None:
        raise UsageError("a loop needs a procedure and --bench, or --continue FILE")
    if only:
        from rig.runs.plans import load_plan  # noqa: PLC0415 - of a queue

        load_plan(procedure, bench, dry=dry, world=world).check_only(only)
    return conducted(
        lambda how: start_loop(procedure, bench, out_dir, dry=dry, world=world, **common, **how),
        asked,
        operator_name,
        as_json=as_json,
        kill_at_point=kill_at_point,
    )


def resume_of_loop(
    path: Path,
    gap: float,
    asked: Listening,
    operator_name: str | None,
    *,
    as_json: bool = False,
    unless_stopped: bool = False,
) -> int:
    """`rig resume` of a program file; with `unless_stopped` not if a person stopped its open run."""
    from rig.loop import open_program, resume_loop, stopped_run  # noqa: PLC0415

    if unless_stopped and (run := stopped_run(open_program(path))) is not None:
        ServiceManager().ended("stopped by rig stop")
        words = f"{run} was stopped by a person; rig resume {shell_word(path)} goes on with the loop"
        err.print(escape(words), soft_wrap=True)
        return ExitCode.STOPPED

    asked = _of_file(asked, path)
    return conducted(lambda how: resume_loop(path, dry_gap_s=gap, **how), asked, operator_name, as_json=as_json)


def _of_file(asked: Listening, path: Path) -> Listening:
    """Options for a loop whose program file says whether it is a dry one."""
    with RunReader.open(path) as reader:
        return replace(asked, dry=reader.about().runs_dry)


class _Told:
    """Says on the terminal and to the listeners what a loop does."""

    def __init__(self, listeners: Listeners, *, as_json: bool) -> None:
        self._listeners, self._json = listeners, as_json
        self.simulated = False
        self.path: Path | None = None

    def begins(self, path: Path, plan: Plan, asked: Listening) -> None:
        """The program file exists."""
        self.path = path
        self.simulated = plan.dry or plan.bench.simulated
        with contextlib.suppress(OSError):  # output without a reader; the loop is more important
            (err if self._json else out).print(escape(str(path)), soft_wrap=True)
        self._listeners.facts = RunFacts(
            path, path.name.removesuffix(".loop.sqlite"), plan.bench.name, plan.procedure.name, self.simulated
        )
        add_default_log(self._listeners, asked)

    def run_begins(self, path: Path) -> None:
        """A run begins, or goes on."""
        self._listeners.look.begins(path)
        err.print(f"run: {escape(str(path))}", soft_wrap=True)

    def says(self, record: Record) -> None:
        """A record of the loop."""
        from rig.loop.timeline import clock_time  # noqa: PLC0415

        self._listeners.recorded(record)
        if record.event.importance.page:
            with contextlib.suppress(OSError):
                words = escape(record.sentence())
                err.print(f"{mark(self.simulated)}[bold]{clock_time(record.utc_s)}[/]: {words}", soft_wrap=True)


@contextlib.contextmanager
def _goes_on(told: _Told) -> Iterator[None]:
    """Say how a loop goes on whose session ends by an error."""
    try:
        yield
    except RigError:
        if told.path is not None:
            err.print(f"the loop goes on with: rig resume {escape(shell_word(told.path))}", soft_wrap=True)
        raise


def conducted(
    begin: Callable[[dict[str, Any]], Ending],
    asked: Listening,
    operator_name: str | None,
    *,
    as_json: bool,
    kill_at_point: int | None = None,
) -> int:
    """Conduct a session of a loop; returns the exit code."""
    from rig.loop import blocks, to_json  # noqa: PLC0415

    by = operator(operator_name)
    facts = RunFacts(None, "", "", "", simulated=asked.dry)
    with listening(facts, asked, lambda text: err.print(f"[bold yellow]{escape(text)}[/]", soft_wrap=True)) as ears:
        ears.lasts()  # a loop goes on after a run has parked
        told = _Told(ears, as_json=as_json)
        with run_progress(simulated=asked.dry) as progress, _goes_on(told):
            ending = begin(
                {
                    "signals": signals(),
                    "announce": lambda path, plan: told.begins(path, plan, asked),
                    "on_progress": killing(heard(ears, progress), kill_at_point),
                    "told": told,
                    "observer": ears,
                    "by": by,
                }
            )
        program = ending.program
        ears.ended(ending.outcome, ending.message, head=ending.head)
    if as_json:
        print_json(to_json(program))
    else:
        show(blocks(program), out)
    if ending.message:
        err.print(escape(ending.message), soft_wrap=True)
    err.print(f"head {ending.head}: keep it elsewhere; `rig verify FILE --head` uses it", soft_wrap=True)
    if program.closed is None:
        err.print(f"continue with: rig resume {escape(shell_word(program.path))}", soft_wrap=True)
        return _EXIT[ending.outcome]
    if ending.unsafe:
        return ExitCode.UNSAFE
    return ExitCode.DONE if program.closed.settled and not program.closed.fault else ExitCode.OUTSIDE_ACCEPTANCE
