"""`rig run`, `resume`, `status`, `hold`, `release`, `stop`."""

from __future__ import annotations

import contextlib
import os
import signal
import sys
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from types import FrameType
from typing import Annotated, Any

import typer
from rich.markup import escape

from rig.cli import app
from rig.cli.runs import check_code, list_runs
from rig.cli.show import err, mark, out, print_json, run_progress
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
    outside,
)
from rig.controller import Result, load_plan, resume_run, start_run
from rig.durations import duration
from rig.engine.early_warning import warnings_of
from rig.engine.live import controller_alive, live_path, read_json, send_request
from rig.engine.run_file import RunReader
from rig.engine.session import Outcome, Progress, Signals
from rig.engine.state import RunState, is_simulated, read_state
from rig.errors import ExitCode, RigError, UsageError
from rig.unattended import Listeners, RunFacts, ServiceManager

RunArgument = Annotated[Path, typer.Argument(help="the run file, DIR/ID.sqlite", show_default=False)]
BenchOption = Annotated[Path, typer.Option("--bench", "-b", help="the bench file", show_default=False)]
ProcedureArgument = Annotated[Path, typer.Argument(help="the procedure file", show_default=False)]
JsonOption = Annotated[bool, typer.Option("--json", help="print the result as JSON")]
KillOption = Annotated[
    int | None,
    typer.Option(
        "--kill-at-point",
        min=1,
        help="for trying out recovery: kill this process with SIGKILL when so many points are done",
        show_default=False,
    ),
]

_EXIT = {
    Outcome.COMPLETE: ExitCode.DONE,
    Outcome.STOPPED: ExitCode.STOPPED,
    Outcome.INTERRUPTED: ExitCode.INTERRUPTED,
    Outcome.FAULT: ExitCode.FAULT,
    Outcome.UNSAFE: ExitCode.UNSAFE,
}


@app.command(rich_help_panel="Running")
def run(
    procedure: ProcedureArgument,
    bench: BenchOption,
    dry: Annotated[
        bool, typer.Option("--dry", help="let simulated instruments take the place of the real ones")
    ] = False,
    world: Annotated[
        Path | None, typer.Option(help="with --dry: the truth behind the simulated bench", show_default=False)
    ] = None,
    out_dir: Annotated[Path, typer.Option("--out", "-o", help="folder for the run file")] = Path("runs"),
    create_only: Annotated[
        bool,
        typer.Option(
            "--create-only", help="ask every instrument who it is, make the run file, and leave the rest to a service"
        ),
    ] = False,
    log: LogOption = None,
    log_format: LogFormatOption = "text",
    notify: NotifyOption = None,
    notify_file: NotifyFileOption = None,
    kill_at_point: KillOption = None,
) -> int:
    """Carry out a procedure on a bench.

    The first line printed is the run file's path. The run survives anything: `rig resume` carries on with it.

    Example: `rig run procedure.toml --bench bench.toml --dry --world world.toml`
    """
    plan = load_plan(procedure, bench, dry=dry, world=world)

    simulated = dry or plan.bench.simulated
    facts = RunFacts(None, "", plan.bench.name, plan.procedure.name, simulated)
    asked = Listening(log, log_format, notify, notify_file, dry=dry, strict=True)
    with listening(facts, asked, _warn) as listeners:

        def announce(path: Path) -> None:
            with contextlib.suppress(OSError):  # nobody reads it; the run matters more
                print(path, flush=True)
            listeners.opened(path, path.stem)
            if not create_only:
                add_default_log(listeners, asked)

        with run_progress(simulated=simulated) as show:
            result = start_run(
                plan,
                out_dir,
                signals=signals(),
                announce=announce,
                on_progress=_killing(heard(listeners, show), kill_at_point),
                observer=listeners,
                create_only=create_only,
            )
        if create_only:
            err.print(
                f"{mark(simulated)}created, nothing was moved; rig resume {escape(str(result.path))}", soft_wrap=True
            )
            return ExitCode.DONE
        code = conclude(result)
        listeners.ended(result.outcome, result.message, note=outside(code))
    return code


@app.command(rich_help_panel="Running")
def resume(
    run_file: RunArgument,
    bench: Annotated[
        Path | None, typer.Option(help="a bench file with new addresses for the same instruments", show_default=False)
    ] = None,
    accept: Annotated[
        list[str] | None,
        typer.Option(help="accept another instrument than before in this place; repeatable", show_default=False),
    ] = None,
    gap: Annotated[
        float, typer.Option(min=0, max=1e7, help="dry runs: seconds the bench was left alone, without power")
    ] = 120.0,
    unless_stopped: Annotated[
        bool,
        typer.Option("--unless-stopped", help="leave a run alone that `rig stop` has stopped: what a service does"),
    ] = False,
    log: LogOption = None,
    log_format: LogFormatOption = "text",
    notify: NotifyOption = None,
    notify_file: NotifyFileOption = None,
    kill_at_point: KillOption = None,
) -> int:
    """Carry on with an interrupted run.

    A dry run's bench begins anew, as after a power cut, so an open whole plot is measured again; `rig sim` keeps a
    simulated bench alive between sessions.

    Example: `rig resume runs/20260115T180000-night-1a2b.sqlite`
    """
    with RunReader.open(run_file) as reader:
        simulated, dry = is_simulated(reader), bool(reader.genesis().data.get("dry"))
        state = read_state(reader) if unless_stopped else RunState()
    if state.rested == "stopped" and state.ended is None:
        ServiceManager().ended("stopped by rig stop")
        name = escape(str(run_file))
        err.print(f"{name} was stopped by a person; rig resume {name} carries on", soft_wrap=True)
        return ExitCode.STOPPED
    asked = Listening(log, log_format, notify, notify_file, dry=dry, strict=False)
    with listening(facts_of(run_file), asked, _warn) as listeners:
        with run_progress(simulated=simulated) as show:
            result = resume_run(
                run_file,
                signals=signals(),
                on_progress=_killing(heard(listeners, show), kill_at_point),
                bench=bench,
                accept=frozenset(accept or ()),
                dry_gap_s=gap,
                warn=lambda text: _warn_and_log(text, listeners),
                observer=listeners,
            )
        code = conclude(result)
        listeners.ended(result.outcome, result.message, note=outside(code))
    return code


def _warn(text: str) -> None:
    err.print(f"[bold yellow]{escape(text)}[/]", soft_wrap=True)


def _warn_and_log(text: str, listeners: Listeners) -> None:
    _warn(text)
    listeners.say("warning", text)


def conclude(result: Result) -> int:
    """Say how a session ended; the exit code."""
    state = result.state
    with contextlib.suppress(OSError):  # a full or closed log does not change how the run ended
        for words in _warnings(result.path):
            err.print(f"[bold yellow]warning:[/] {escape(words)}", soft_wrap=True)
        if result.message and result.outcome is not Outcome.INTERRUPTED:
            print(f"rig: {result.message}", file=sys.stderr)
        for index, reason in sorted(state.skipped.items()):
            err.print(f"[yellow]point {index} was skipped:[/] {escape(reason)}")
        for number, reason in state.lost.items():
            err.print(
                f"[yellow]whole plot {number} was lost and measured again under a new identity:[/] {escape(reason)}",
                soft_wrap=True,
            )
        words = f"{result.outcome.value}: {len(state.accepted)} of {state.points} points observed"
        err.print(f"{mark(state.simulated)}{words} in {duration(state.elapsed_s)}")
        if result.outcome is Outcome.COMPLETE and (not state.accepted or _outside_acceptance(result)):
            return ExitCode.OUTSIDE_ACCEPTANCE
    return _EXIT[result.outcome]


def _warnings(run_file: Path) -> list[str]:
    """Early warnings of a run; none of a file that cannot be read, about which others say more."""
    with contextlib.suppress(RigError), RunReader.open(run_file) as reader:
        return [str(record.data["message"]) for record in warnings_of(reader)]
    return []


def _outside_acceptance(result: Result) -> bool:
    """Hold a complete run against the procedure's acceptance limits; says what it found."""
    from rig.acceptance import judge  # noqa: PLC0415

    if result.procedure is None:
        return False
    try:
        verdicts = judge(result.procedure, result.path)
    except RigError as error:
        err.print(f"[red]acceptance cannot be judged:[/] {escape(str(error))}")
        return True
    for verdict in verdicts:
        if not verdict.inside:
            err.print(f"[red]{escape(verdict.sensor)} is outside acceptance:[/] {escape(verdict.found)}")
    if verdicts and all(verdict.inside for verdict in verdicts):
        err.print(f"every sensor is inside acceptance ({verdicts[0].limit})")
    return any(not verdict.inside for verdict in verdicts)


def signals() -> Signals:
    """SIGINT, SIGTERM and SIGHUP (a lost terminal) stop motion and leave the run resumable."""
    signals = Signals()

    def note(number: int, _frame: FrameType | None) -> None:
        signals.interrupt = signal.Signals(number).name

    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, note)
    return signals


def _killing(show: Callable[[Progress], None], at_point: int | None) -> Callable[[Progress], None]:
    if at_point is None:
        return show

    def show_or_die(news: Progress) -> None:
        if news.done >= at_point:
            os.kill(os.getpid(), signal.SIGKILL)
        show(news)

    return show_or_die


@app.command(rich_help_panel="Running")
def status(
    run_file: Annotated[Path, typer.Argument(help="a run file, or a folder of them", show_default=False)] = Path(
        "runs"
    ),
    as_json: JsonOption = False,
    check: Annotated[
        bool, typer.Option("--check", help="end with an exit code that tells: see docs/exit-codes.md")
    ] = False,
) -> int:
    """Show what a run has come to, running or not; of a folder, its runs, the newest first.

    With --check it ends with 0 if the run is complete, 6 if it is running, 4 if it was stopped, 1 if it ended by a
    fault, 75 if it was interrupted or never begun.

    Examples: `rig status runs/ID.sqlite`, `rig status runs`, `rig status RUN --check && rig fit RUN`
    """
    if run_file.is_dir():
        return list_runs(run_file, as_json=as_json, check=check)
    with RunReader.open(run_file) as reader:
        state, genesis = read_state(reader), reader.genesis()
        count, head = reader.head()
    live = read_json(live_path(run_file)) or {}
    running = bool(live) and controller_alive(run_file)
    summary: dict[str, Any] = {
        "run_id": state.run_id,
        "simulated": state.simulated,
        "procedure": genesis.data.get("procedure", ""),
        "bench": genesis.data.get("bench", ""),
        "state": live["state"] if running else state.ended or state.rested,
        "running": running,
        "points": state.points,
        "accepted": len(state.accepted),
        "skipped": {str(k): v for k, v in state.skipped.items()},
        "sessions": state.sessions,
        "elapsed_s": live["elapsed_s"] if running else state.elapsed_s,
        "remaining_s": live.get("remaining_s") if running else None,
        "last_record_utc": datetime.fromtimestamp(state.utc_s, UTC).isoformat(timespec="seconds"),
        "last_fault": state.last_fault,
        "decisions": state.decisions,
        "faults": [fault._asdict() for fault in state.faults],
        "safe": state.safe,
        "message": f"{live.get('message', '')} {live.get('detail', '')}".strip() if running else "",
        "warnings": _warnings(run_file),
        "whole_plots_lost": {str(k): v for k, v in state.lost.items()},
        "records": count,
        "head": head.hex(),
    }
    code = check_code(state, run_file) if check else ExitCode.DONE
    if as_json:
        print_json(summary)
        return code
    left = "" if summary["remaining_s"] is None else f", {duration(summary['remaining_s'])} left"
    what, where = escape(summary["procedure"]), escape(summary["bench"])
    out.print(f"{mark(state.simulated)}[bold]{what}[/] on {where}: {summary['state']}")
    out.print(f"  {summary['accepted']} of {summary['points']} points in {duration(summary['elapsed_s'])}{left}")
    out.print(f"  {summary['sessions']} session(s), last record {summary['last_record_utc']}")
    for index, why in summary["skipped"].items():
        out.print(f"  [yellow]point {index} skipped:[/] {escape(why)}")
    for number, why in summary["whole_plots_lost"].items():
        out.print(f"  [yellow]whole plot {number} was lost and measured again:[/] {escape(why)}", soft_wrap=True)
    for words in summary["warnings"]:
        out.print(f"  [bold yellow]warning:[/] {escape(words)}", soft_wrap=True)
    _tell_faults(state)
    if state.last_fault and not running:
        out.print(f"  [red]last fault:[/] {escape(state.last_fault)}", soft_wrap=True)
    if summary["message"]:
        out.print(f"  {escape(summary['message'])}")
    if not running and state.ended is None:
        out.print(f"  carry on with: rig resume {escape(str(run_file))}", soft_wrap=True)
    return code


_FAULTS_TOLD = 5


def _tell_faults(state: RunState) -> None:
    """What went wrong so far, and what was done about it."""
    if not state.decisions:
        return
    counts = ", ".join(f"{decision} {count}x" for decision, count in state.decisions.items())
    out.print(f"  [yellow]faults, and what was done:[/] {escape(counts)}", soft_wrap=True)
    for fault in list(state.faults)[-_FAULTS_TOLD:]:
        where = "" if fault.point is None else f"point {fault.point}, "
        words = f"{duration(fault.elapsed_s)}: {where}{fault.decision}: {fault.message}"
        out.print(f"    {escape(words)}", soft_wrap=True)


def _ask(run_file: Path, verb: str) -> int:
    if not run_file.exists():
        raise UsageError(f"there is no run file {run_file}")
    from drivers.clock import RealClock  # noqa: PLC0415

    clock = RealClock()
    give_up = clock.now() + 30.0
    request_id = ""
    while clock.now() < give_up:
        if not request_id:
            with contextlib.suppress(FileExistsError):
                posted = send_request(run_file, verb)
                if posted is None:
                    status = f"`rig status {run_file}` shows what it has come to"
                    raise UsageError(f"no controller is running on {run_file}; {status}")
                request_id = posted
        live = read_json(live_path(run_file))
        if live is not None and live.get("acknowledged") == request_id:
            break
        if not controller_alive(run_file):
            return _ended(run_file, verb)
        clock.sleep(0.05)
    else:
        raise RigError(f"the controller of {run_file} did not acknowledge within 30 s; look at the process itself")
    err.print(f"{verb}: acknowledged")
    return ExitCode.DONE


def _ended(run_file: Path, verb: str) -> int:
    """The controller ended before it acknowledged: was that what was asked for?"""
    with RunReader.open(run_file) as reader:
        state = read_state(reader)
    how = state.ended or state.rested
    if verb == "stop" and how in ("stopped", "complete"):
        err.print(f"{verb}: the run is {how}")
        return ExitCode.DONE
    raise RigError(f"the controller ended before it could {verb}: the run is {how}; `rig status {run_file}` says more")


@app.command(rich_help_panel="Running")
def hold(run_file: RunArgument) -> int:
    """Stop all motion, leave chambers as they are, and wait; `rig release` lets the run go on."""
    return _ask(run_file, "hold")


@app.command(rich_help_panel="Running")
def release(run_file: RunArgument) -> int:
    """Let a held run go on."""
    return _ask(run_file, "release")


@app.command(rich_help_panel="Running")
def stop(run_file: RunArgument) -> int:
    """Park the bench and end the session; the run can be resumed later."""
    return _ask(run_file, "stop")
