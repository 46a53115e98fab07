"""`rig` alone: what runs here, what waits for somebody, and what to do next."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from rich.markup import escape

from rig.cli.show import out
from rig.cli.status import rows_of
from rig.errors import ExitCode, RigError
from rig.procedures.present.durations import duration
from rig.procedures.present.shell import shell_word
from rig.queue import open_queue
from rig.run_file.live import asked_by_hand, done_command, read_live

RUNS = Path("runs")
_MOST = 5
"""Lines of each part at most: it is one screen."""
_BEGIN = (
    ("rig demo", "a simulated night: killed, resumed, fitted, traced, reported"),
    ("rig new FOLDER", "questions about your bench; makes its files and shows the plan"),
    ("rig --help", "all commands"),
)
Row = dict[str, Any]


def home() -> None:
    """Show what runs in `runs/`, what waits for somebody, and the next commands."""
    rows = rows_of(RUNS) if RUNS.is_dir() else []
    running = [_at_work(row) for row, _ in rows if row.get("running")]
    waiting = [line for row, code in rows for line in waits(row, code)] + list(_queued(RUNS / "queue.sqlite"))
    if not rows and not waiting:
        out.print("Nothing has run in this folder. Begin with:\n")
        _show(_columns(_BEGIN))
        return
    out.print("[bold]At work[/]" if running else "Nothing is at work.")
    _show(running)
    out.print("\n[bold]Waits for you[/]" if waiting else "\nNothing waits for you.")
    _show(waiting)
    out.print("\n[bold]Next[/]")
    _show(_columns([*_next(rows), ("rig status runs", "all runs"), ("rig --help", "all commands")]))


def _show(lines: Sequence[str]) -> None:
    for line in lines[:_MOST]:
        out.print(f"  {escape(line)}", soft_wrap=True, highlight=False)
    if len(lines) > _MOST:
        out.print(f"  and {len(lines) - _MOST} more: rig status runs")


def _columns(pairs: Sequence[tuple[str, str]]) -> list[str]:
    width = max(len(command) for command, _ in pairs) + 2
    return [f"{command:<{width}}{what}" for command, what in pairs]


def _at_work(row: Row) -> str:
    left = "" if row["remaining_s"] is None else f", {duration(row['remaining_s'])} left"
    mark = "SIMULATED " if row["simulated"] else ""
    return f"{mark}{row['run_file']}: {row['state']}, {row['done']} of {row['points']}{left}"


def waits(row: Row, code: int) -> Iterator[str]:
    """Lines of what a run needs of somebody, with the command."""
    file = Path(row["run_file"])
    if "message" in row:
        yield f"{file} cannot be used: rig verify {shell_word(file)}"
    elif row["running"]:
        asked = asked_by_hand(read_live(file) or {})
        if asked is not None:
            yield f"{file}: {asked.say}: {done_command(file, asked.value)}"
        elif row["state"] == "holding":
            yield f"{file} holds: rig release {shell_word(file)}"
    elif code == ExitCode.UNSAFE:
        yield f"{file} ended by a fault, and the bench is NOT SAFE: rig status {shell_word(file)}"
    elif code in (ExitCode.INTERRUPTED, ExitCode.FAULT, ExitCode.STOPPED):
        yield f"{file}: {row['state']}: rig resume {shell_word(file)}"


def _queued(file: Path) -> Iterator[str]:
    """Items of the queue that wait."""
    if not file.exists():
        return
    try:
        _, queue = open_queue(file)
    except RigError as error:
        yield str(error)
        return
    if queue.held:
        yield f"held by an item of the queue: {', '.join(queue.held)}: rig queue list"
    if count := len(queue.waiting):
        items = "1 item waits" if count == 1 else f"{count} items wait"
        yield f"{items} in the queue: {'rig queue pause --off' if queue.paused else 'rig queue run'}"


def _next(rows: Sequence[tuple[Row, int]]) -> Iterator[tuple[str, str]]:
    """Commands for the newest run that is complete."""
    done = (row for row, code in rows if code in (ExitCode.DONE, ExitCode.OUTSIDE_ACCEPTANCE) and not row["running"])
    newest = next((row for row in done if not row["state"].startswith("loop")), None)
    if newest is not None:
        file = shell_word(newest["run_file"])
        mark = "SIMULATED: " if newest["simulated"] else ""
        yield f"rig trace {file}", f"{mark}what its model lacks"
        yield f"rig fit {file} --out calibration.json", f"{mark}its calibration"
