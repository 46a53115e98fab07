"""`rig status`: what a run has come to, or the runs of a folder."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.markup import escape

from procedures.durations import duration
from rig.cli import app
from rig.cli.accepted import Acceptance
from rig.cli.run import JsonOption, warnings_in
from rig.cli.runs import check_code, list_runs
from rig.cli.show import mark, out, print_json
from rig.engine.time_left import left_when_resumed_s
from rig.errors import ExitCode, RigError
from rig.plans import has_plan, stored_plan
from rig.run_file.audit import Finding
from rig.run_file.chain import Record
from rig.run_file.elsewhere import goes_on_in
from rig.run_file.events.bench import Fault
from rig.run_file.live import read_live, silent_s
from rig.run_file.opening import sensible
from rig.run_file.reader import RunReader
from rig.run_file.state import RunState
from rig.run_file.verification import CUT_SHORT, glance


@app.command()
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

    A complete run is fitted and held against its procedure's acceptance limits, as at its end.

    With --check it ends with 0 if the run is complete, 6 if it is running, 4 if it was stopped, 1 if it ended by a
    fault, 75 if it was interrupted or never begun. A file that was edited or damaged ends with 1 in any case.

    Examples: `rig status runs/ID.sqlite`, `rig status runs`, `rig status RUN --check && rig fit RUN`
    """
    if run_file.is_dir():
        return list_runs(run_file, as_json=as_json, check=check)
    with sensible(run_file):
        return _status(run_file, check=check, as_json=as_json)


def _status(run_file: Path, *, check: bool, as_json: bool) -> ExitCode:
    """Of one run file."""
    reader, state, wrong, looked = glance(run_file, VERIFIED)
    with reader:
        run = reader.about()
        count, head = reader.head()
        other = goes_on_in(reader, state)
        said = read_live(run_file)
        running, live = said is not None, said or {}
        broken = wrong is not None and wrong.where not in CUT_SHORT
        remaining_s = live.get("remaining_s") if running or broken else _left_when_resumed_s(reader, state, run_file)
    summary: dict[str, Any] = {
        "run_id": state.run_id,
        "simulated": state.simulated,
        "procedure": run.procedure or "",
        "bench": run.bench or "",
        "state": live["state"] if running else state.ended or state.rested,
        "running": running,
        "points": state.points,
        "accepted": len(state.accepted),
        "skipped": {str(k): v for k, v in state.skipped.items()},
        "sessions": state.sessions,
        "operators": state.operators,
        "elapsed_s": live.get("elapsed_s", state.elapsed_s),
        "remaining_s": remaining_s,
        "last_record_utc": datetime.fromtimestamp(state.utc_s, UTC).isoformat(timespec="seconds"),
        "last_fault": state.last_fault,
        "decisions": state.decisions,
        "faults": [_fault(record) for record in state.faults],
        "safe": state.safe,
        "message": f"{live.get('message', '')} {live.get('detail', '')}".strip() if running else "",
        "warnings": warnings_in(run_file),
        "whole_plots_lost": {str(k): v for k, v in state.lost.items()},
        "records": count,
        "head": head.hex(),
        "whole": False if wrong else True if looked else None,
        "finding": str(wrong) if wrong else "",
        "goes_on_in": str(other) if other else None,
    }
    judged = state.ended == "complete" and state.accepted and not broken
    acceptance = Acceptance.of_run(run_file) if judged else Acceptance()
    summary["acceptance"] = acceptance.to_json()
    code = ExitCode.FAULT if broken else check_code(state, run_file) if check else ExitCode.DONE
    if as_json:
        print_json(summary)
        return code
    left = "" if remaining_s is None else f", {duration(remaining_s)} left"
    if remaining_s is not None and not running:
        left = f", about {duration(remaining_s)} left once it is resumed"
    what, where = escape(summary["procedure"]), escape(summary["bench"])
    out.print(f"{mark(state.simulated)}[bold]{what}[/] on {where}: {escape(summary['state'])}")
    out.print(f"  {summary['accepted']} of {summary['points']} points in {duration(summary['elapsed_s'])}{left}")
    by = f" by {escape(', '.join(state.operators))}" if state.operators else ""
    out.print(f"  {summary['sessions']} session(s){by}, last record {summary['last_record_utc']}", soft_wrap=True)
    out.print(f"  head {summary['head']} of {count} records", soft_wrap=True, highlight=False)
    acceptance.show(out, indent="  ")
    name = escape(str(run_file))
    _tell_whole(summary, wrong, name)
    for index, why in summary["skipped"].items():
        out.print(f"  [yellow]point {index} skipped:[/] {escape(why)}")
    for number, why in summary["whole_plots_lost"].items():
        out.print(f"  [yellow]whole plot {number} was lost and measured again:[/] {escape(why)}", soft_wrap=True)
    for words in summary["warnings"]:
        out.print(f"  [bold yellow]warning:[/] {escape(words)}", soft_wrap=True)
    _tell_faults(state)
    if state.last_fault and not running and state.ended is None:
        out.print(f"  [red]last fault:[/] {escape(state.last_fault)}", soft_wrap=True)
    if state.safe.get("unsafe") and not running and state.ended is None:
        out.print(
            f"  [bold red]NOT in its safe state:[/] {escape('; '.join(map(str, state.safe['unsafe'])))}", soft_wrap=True
        )
    if summary["message"]:
        out.print(f"  {escape(summary['message'])}")
    quiet_s = _silence(run_file) if running else 0.0
    if quiet_s > _QUIET_S:
        out.print(f"  [bold yellow]nothing heard from its controller for {duration(quiet_s)}[/]")
    if other is not None:
        out.print("  [bold yellow]it was moved or replaced while it was written, and goes on in another file[/]")
    elif state.rescued:
        lost = f"goes on in {escape(state.rescued)}, which is not there: look for it before you carry on here"
        out.print(f"  [bold yellow]{lost}[/]", soft_wrap=True)
    if not running and state.ended is None and not broken:
        out.print(f"  carry on with: rig resume {name if other is None else escape(str(other))}", soft_wrap=True)
    return code


def _tell_whole(summary: Mapping[str, Any], wrong: Finding | None, name: str) -> None:
    """Whether the file is whole."""
    if wrong is not None and wrong.where in CUT_SHORT:
        out.print(
            f"  [bold yellow]cut short:[/] {escape(str(wrong))}; rig resume measures again what is gone", soft_wrap=True
        )
    elif wrong:
        what = f"edited or damaged: {escape(str(wrong))}. Do not trust what is said here; rig verify {name} lists all"
        out.print(f"  [bold red]NOT WHOLE:[/] {what}", soft_wrap=True)
    elif summary["whole"] is None:
        out.print(f"  not verified, {summary['records']} records take a while: rig verify {name}", soft_wrap=True)


def _left_when_resumed_s(reader: RunReader, state: RunState, run_file: Path) -> float | None:
    """How long the rest of an interrupted run will take; None where that cannot be told."""
    if state.ended is not None or not has_plan(reader):
        return None
    try:
        plan = stored_plan(reader, run_file, None)
        return left_when_resumed_s(reader, state, plan.run_list, plan.procedure.conduct, plan.bench)
    except RigError:
        return None  # what is wrong with the file stands elsewhere


def _silence(run_file: Path) -> float:
    from drivers.clock import RealClock  # noqa: PLC0415

    return silent_s(run_file, RealClock().utc())


_FAULTS_TOLD, _QUIET_S = 5, 60.0
VERIFIED = 100_000
"""A run of so many records at most is verified on the way: about two seconds."""


def _tell_faults(state: RunState) -> None:
    """What went wrong so far, and what was done about it."""
    if not state.decisions:
        return
    counts = ", ".join(f"{decision} {count}x" for decision, count in state.decisions.items())
    out.print(f"  [yellow]faults, and what was done:[/] {escape(counts)}", soft_wrap=True)
    for record in list(state.faults)[-_FAULTS_TOLD:]:
        out.print(f"    {escape(f'{duration(record.elapsed_s)}: {record.sentence()}')}", soft_wrap=True)


def _fault(record: Record) -> dict[str, Any]:
    event = record.event
    assert isinstance(event, Fault)
    about = {"elapsed_s": record.elapsed_s, "point": record.run_index}
    return about | {"message": event.message, "decision": event.decided}
