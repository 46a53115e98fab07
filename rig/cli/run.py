"""`rig run`, `resume`."""

from __future__ import annotations

import contextlib
import sys
from collections import Counter
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from rig.cli.commands import app
from rig.cli.options import BenchOption, OnlyOption, OperatorOption, ProcedureArgument, RunArgument
from rig.cli.progress import run_progress
from rig.cli.show import err, mark, outlive_readers
from rig.cli.signals import KillOption, killing, signals
from rig.cli.signed_in import LoginOption, acting
from rig.cli.unattended import (
    Listening,
    LogFormatOption,
    LogOption,
    NotifyFileOption,
    NotifyOption,
    add_default_log,
    facts_of,
    heard,
    listening,
    remarks,
)
from rig.engine.early_warning import warnings_in
from rig.engine.session import Outcome
from rig.errors import ExitCode, RigError, UsageError
from rig.files.atomic import check_added_to
from rig.procedures.present.durations import duration
from rig.procedures.present.shell import shell_word
from rig.procedures.present.terminal import show
from rig.procedures.present.visible import visible
from rig.register import DOCUMENT
from rig.run_file.events.points import OVERSHOT, Observed
from rig.run_file.read.reader import RunReader
from rig.run_file.state.state import RunState, is_simulated, read_state
from rig.run_file.verify.verification import LOOP_SUFFIX
from rig.runs.accepted import Acceptance
from rig.runs.controller import Result, resume_run, start_run
from rig.runs.plans import Plan, load_plan
from rig.unattended import Listeners, RunFacts, ServiceManager

_EXIT = {
    Outcome.COMPLETE: ExitCode.DONE,
    Outcome.STOPPED: ExitCode.STOPPED,
    Outcome.INTERRUPTED: ExitCode.INTERRUPTED,
    Outcome.FAULT: ExitCode.FAULT,
    Outcome.UNSAFE: ExitCode.UNSAFE,
}


@app.command()
def run(
    procedure: ProcedureArgument,
    bench: BenchOption,
    dry: Annotated[bool, typer.Option("--dry", help="replace the real instruments by simulated ones")] = False,
    world: Annotated[
        Path | None, typer.Option(help="with --dry: the world file of the simulated bench", show_default=False)
    ] = None,
    out_dir: Annotated[Path, typer.Option("--out", "-o", help="folder for the run file")] = Path("runs"),
    create_only: Annotated[
        bool,
        typer.Option("--create-only", help="check identities, create the run file, and leave the run to a service"),
    ] = False,
    operator_name: OperatorOption = None,
    login: LoginOption = None,
    log: LogOption = None,
    log_format: LogFormatOption = "text",
    notify: NotifyOption = None,
    notify_file: NotifyFileOption = None,
    kill_at_point: KillOption = None,
    only: OnlyOption = "",
) -> int:
    """Carry out a procedure on a bench.

    The first line printed is the run file's path. The run survives crashes: `rig resume` continues it.

    Examples:

    - `rig run procedure.toml --bench bench.toml`
    - `rig run procedure.toml --bench bench.toml --dry --world world.toml`
    - `rig run night.toml --bench bench.toml --operator "Anna Berg" --notify`
    """
    outlive_readers()
    by = acting(bench, login, operator_name)
    check_added_to(log, [procedure, bench, world, notify_file])
    plan = load_plan(procedure, bench, dry=dry, world=world)
    plan.check_only(only)

    simulated = dry or plan.bench.simulated
    facts = RunFacts(None, "", plan.bench.name, plan.procedure.name, simulated)
    asked = Listening(log, log_format, notify, notify_file, dry=dry, strict=True)
    with listening(facts, asked, _warn) as listeners:

        def announce(path: Path) -> None:
            with contextlib.suppress(OSError):  # output without a reader; the run is more important
                print(path, flush=True)
                if dry:
                    _say_date(plan)
            listeners.opened(path, path.stem)
            if not create_only:
                add_default_log(listeners, asked)

        with run_progress(simulated=simulated) as progress:
            result = start_run(
                plan,
                out_dir,
                signals=signals(),
                announce=announce,
                on_progress=killing(heard(listeners, progress), kill_at_point),
                observer=listeners,
                create_only=create_only,
                by=by,
            )
        if create_only:
            err.print(
                f"{mark(simulated)}created; nothing has moved; rig resume {escape(shell_word(result.path))}",
                soft_wrap=True,
            )
            return ExitCode.DONE
        code = conclude(result)
        listeners.ended(result.outcome, result.message, **remarks(code, result.state), head=result.head)
    return code


def _say_date(plan: Plan) -> None:
    """Say the simulated date of a dry run and why, where a register decides it."""
    from rig.simulated.calendar import why  # noqa: PLC0415 - a real run never loads the simulation

    if said := why(plan.truth, plan.bench, plan.documents.get(DOCUMENT)):
        err.print(f"{mark(True)}it begins on {escape(said)}", soft_wrap=True, highlight=False)


@app.command()
def resume(
    run_file: RunArgument,
    bench: Annotated[
        Path | None,
        typer.Option(
            help="a bench file with new addresses for the same instruments; everything else must be unchanged",
            show_default=False,
        ),
    ] = None,
    accept: Annotated[
        list[str] | None,
        typer.Option(help="accept an exchanged instrument of this name; repeatable", show_default=False),
    ] = None,
    gap: Annotated[
        float, typer.Option(min=0, max=1e7, help="dry runs: gap since the last session without power, seconds")
    ] = 120.0,
    unless_stopped: Annotated[
        bool,
        typer.Option("--unless-stopped", help="do not resume a run stopped by `rig stop`: used by services"),
    ] = False,
    operator_name: OperatorOption = None,
    login: LoginOption = None,
    log: LogOption = None,
    log_format: LogFormatOption = "text",
    notify: NotifyOption = None,
    notify_file: NotifyFileOption = None,
    kill_at_point: KillOption = None,
) -> int:
    """Resume an interrupted run.

    A dry run's bench begins again, as after a power cut, so an open whole plot is measured again; `rig sim` keeps a
    simulated bench alive between sessions.

    Examples:

    - `rig resume runs/20260115T180000-night-1a2b.sqlite`
    - `rig resume RUN --bench moved.toml`
    - `rig resume NAME.loop.sqlite`
    """
    outlive_readers()
    if run_file.name.endswith(LOOP_SUFFIX):
        from rig.cli.loop import resume_of_loop  # noqa: PLC0415

        if bench is not None or accept or kill_at_point is not None:
            raise UsageError("of the options about the bench, only --gap is for a loop: resume its open run with them")
        if login is not None:
            raise UsageError("a loop takes no --login: resume its open run with it")
        heard_by = Listening(log, log_format, notify, notify_file, dry=False, strict=False)
        return resume_of_loop(run_file, gap, heard_by, operator_name, unless_stopped=unless_stopped)
    by = acting(run_file, login, operator_name)
    check_added_to(log, [run_file, bench, notify_file])
    with RunReader.open(run_file) as reader:
        simulated, dry = is_simulated(reader), reader.about().runs_dry
        state = read_state(reader) if unless_stopped else RunState()
    if state.rested == "stopped" and state.ended is None:
        ServiceManager().ended("stopped by rig stop")
        name = escape(str(run_file))
        err.print(
            f"{name} was stopped by a person; rig resume {escape(shell_word(run_file))} continues it", soft_wrap=True
        )
        return ExitCode.STOPPED
    asked = Listening(log, log_format, notify, notify_file, dry=dry, strict=False)
    with listening(facts_of(run_file), asked, _warn) as listeners:
        with run_progress(simulated=simulated) as progress:
            result = resume_run(
                run_file,
                signals=signals(),
                on_progress=killing(heard(listeners, progress), kill_at_point),
                bench=bench,
                accept=frozenset(accept or ()),
                dry_gap_s=gap,
                warn=lambda text: _warn_and_log(text, listeners),
                observer=listeners,
                by=by,
            )
        code = conclude(result)
        listeners.ended(result.outcome, result.message, **remarks(code, result.state), head=result.head)
    return code


def _warn(text: str) -> None:
    err.print(f"[bold yellow]{escape(text)}[/]", soft_wrap=True)


def _warn_and_log(text: str, listeners: Listeners) -> None:
    _warn(text)
    listeners.say("warning", text)


_WHY = {OVERSHOT: "a setting had gone beyond its level, and was approached again from the planned side"}
"""Reasons for flags that no fault has."""


def conclude(result: Result) -> int:
    """Report the end of a session; returns the exit code."""
    state = result.state
    with contextlib.suppress(OSError):  # a full or closed log does not change the result of the run
        for words in warnings_in(result.path):
            err.print(f"[bold yellow]warning:[/] {escape(words)}", soft_wrap=True)
        for words in state.left_on:
            err.print(f"[bold yellow]left on:[/] {escape(words)}", soft_wrap=True)
        if result.message and (result.outcome is not Outcome.INTERRUPTED or result.parked):
            print(f"rig: {visible(result.message)}", file=sys.stderr)
        for index, reason in sorted(state.skipped.items()):
            err.print(f"[yellow]point {index} was skipped:[/] {escape(reason)}")
        for number, reason in state.lost.items():
            err.print(
                f"[yellow]whole plot {number} was lost and measured again under a new identity:[/] {escape(reason)}",
                soft_wrap=True,
            )
        for flag, count in _flagged(result.path).items():
            what = "1 point is" if count == 1 else f"{count} points are"
            why = _WHY.get(flag, "`rig status RUN` says why")
            err.print(f"[bold yellow]warning:[/] {what} flagged {escape(flag)}; {why}", soft_wrap=True)
        words = f"{result.outcome.value}: {len(state.accepted)} of {state.points} points observed"
        err.print(f"{mark(state.simulated)}{words} in {duration(state.elapsed_s)}")
        if result.head:
            err.print(
                f"head {result.head}: keep it elsewhere; `rig verify RUN --head` uses it to detect changes of the file",
                soft_wrap=True,
                highlight=False,
            )
        if result.outcome in (Outcome.INTERRUPTED, Outcome.STOPPED):
            err.print(f"continue with: rig resume {escape(shell_word(result.path))}", soft_wrap=True, highlight=False)
        if result.outcome is Outcome.COMPLETE:
            outside = bool(state.accepted) and _outside_acceptance(result)
            lost = len(state.skipped)
            if lost:  # the last line
                words = (
                    f"{lost} of {state.points} points were lost, and are in no table: the first, {min(state.skipped)}, "
                )
                err.print(f"[bold red]{words}{escape(state.skipped[min(state.skipped)])}[/]", soft_wrap=True)
            if outside or state.too_few:
                return ExitCode.OUTSIDE_ACCEPTANCE
    return _EXIT[result.outcome]


def _flagged(path: Path) -> Counter[str]:
    """Number of accepted points with each flag."""
    counts: Counter[str] = Counter()
    with contextlib.suppress(RigError), RunReader.open(path) as reader:
        for record in reader.records(Observed.kind):
            if record.accepted and isinstance(record.event, Observed):
                counts.update(record.event.flags)
    return counts


def _outside_acceptance(result: Result) -> bool:
    """Compare a complete run with the procedure's acceptance limits, and print the result."""
    if result.procedure is None:
        return False
    acceptance = Acceptance.of(result.procedure, result.path)
    show(acceptance.blocks(), err)
    return acceptance.outside
