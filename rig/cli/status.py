"""The command `rig status`: lines on a run (`Status.blocks` in `rig/verbs/run/status.py`), or the list of a folder."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.markup import escape
from rich.table import Table

from rig.cli.commands import app
from rig.cli.options import JsonOption
from rig.cli.show import err, out, print_json
from rig.errors import ExitCode, RigError, UsageError
from rig.files.regular import real_path
from rig.procedures.present.durations import duration
from rig.procedures.present.shell import shell_word
from rig.procedures.present.terminal import print_whole, show
from rig.run_file.events.sessions import RunCreated
from rig.run_file.live import controller_alive, read_live
from rig.run_file.read.safe_opening import sensible
from rig.run_file.state.state import RunState
from rig.run_file.verify.verification import CUT_SHORT, LOOP_SUFFIX, glance
from rig.verbs.run.status import status_of


@app.command()
def status(
    run_file: Annotated[Path, typer.Argument(help="a run file, or a folder of them", show_default=False)] = Path(
        "runs"
    ),
    as_json: JsonOption = False,
    check: Annotated[
        bool, typer.Option("--check", help="use the exit code for the state: see docs/reference/exit_codes.md")
    ] = False,
) -> int:
    """Show the state of a run, running or not; for a folder, its runs, newest first.

    A complete run is fitted and compared with its procedure's acceptance limits, as at its end.

    With --check the exit code is 0 if the run is complete, 3 if it lost more than a tenth of its points, 6 if it is
    running, 4 if it was stopped, 1 if it ended by a fault, 5 if the bench is then not known to be safe, 75 if it was
    interrupted or never begun. An edited or damaged file gives 1 in any case.

    Examples:

    - `rig status runs/ID.sqlite`
    - `rig status runs`
    - `rig status RUN --check && rig fit RUN`
    """
    if run_file.is_dir():
        return list_runs(run_file, as_json=as_json, check=check)
    if run_file.name.endswith(LOOP_SUFFIX):
        from rig.cli.status_of_loop import show_loop  # noqa: PLC0415 - few files are loops, and these load a bench

        return show_loop(run_file, as_json=as_json, check=check)
    found = status_of(run_file)
    if as_json:
        print_json(found.to_json())
    else:
        show(found.blocks(), out)
    return ExitCode.FAULT if found.broken else check_code(found.state, run_file) if check else ExitCode.DONE


_VERIFIED = 10_000
"""Maximum number of records of a run that is verified in a list, so that a folder is listed within seconds."""
_RESTED = {"stopped": ExitCode.STOPPED, "faulted": ExitCode.FAULT}


def check_code(state: RunState, run_file: Path) -> ExitCode:
    """Exit code for the state of a run: complete, running (also starting), stopped, faulted, unsafe or interrupted."""
    if controller_alive(run_file):
        return ExitCode.RUNNING
    if state.ended is not None:
        return ExitCode.OUTSIDE_ACCEPTANCE if state.too_few else ExitCode.DONE
    if state.unsafe:
        return ExitCode.UNSAFE
    return _RESTED.get(state.rested, ExitCode.INTERRUPTED)


def list_runs(folder: Path, *, as_json: bool, check: bool) -> int:
    """Show the runs of a folder, newest first. With `check` the code is that of the first incomplete one."""
    found = rows_of(folder)
    if not found:
        raise UsageError(f"there are no run files in {folder}")
    rows, codes = [row for row, _ in found], [code for _, code in found]
    if as_json:
        print_json(rows)
    else:
        _show(rows)
    return next((code for code in codes if code), ExitCode.DONE) if check else ExitCode.DONE


_NO_RUNS = ("queue.sqlite", "log.sqlite")


def rows_of(folder: Path) -> list[tuple[dict[str, Any], int]]:
    """Each run and loop of a folder, newest first, and its exit code for `--check`."""
    own = (one for one in folder.glob("*.sqlite") if one.name not in _NO_RUNS and not one.name.startswith("."))
    paths = sorted(own, key=_changed, reverse=True)
    return [_row(path) for path in paths]


def _changed(path: Path) -> float:
    """Time of the last write to a run; its log file counts, because the main file may be hours older."""
    real = real_path(path)
    log = real.with_name(real.name + "-wal")
    return max((p.stat().st_mtime for p in (real, log) if p.exists()), default=0.0)


def _row(path: Path) -> tuple[dict[str, Any], int]:
    try:
        if path.name.endswith(LOOP_SUFFIX):
            from rig.cli.status_of_loop import loop_row  # noqa: PLC0415

            return loop_row(path)
        reader, state, wrong, _ = glance(path, _VERIFIED)
        with reader:
            about = reader.about()
        if wrong is not None and wrong.where not in CUT_SHORT:
            message = (
                f"{path} was edited or damaged: {wrong}; rig verify {shell_word(path)} lists everything that is wrong"
            )
            return {"run_file": str(path), "state": "not whole", "message": message}, int(ExitCode.FAULT)
        with sensible(path):
            return _known(path, state, about)
    except RigError as error:
        return {"run_file": str(path), "state": "unreadable", "message": str(error)}, int(ExitCode.FAULT)


def _known(path: Path, state: RunState, about: RunCreated) -> tuple[dict[str, Any], int]:
    """A run's line, and its exit code for `--check`."""
    said = read_live(path)
    running, live = said is not None, said or {}
    row = {
        "run_file": str(path),
        "state": live["state"] if running else state.ended or state.rested,
        "running": running,
        "simulated": state.simulated,
        "procedure": about.procedure or "",
        "bench": about.bench or "",
        "points": state.points,
        "done": len(state.accepted) + len(state.skipped),
        "elapsed_s": live.get("elapsed_s", state.elapsed_s),
        "remaining_s": live.get("remaining_s"),
        "last_record_utc": datetime.fromtimestamp(state.utc_s, UTC).isoformat(timespec="seconds"),
        "last_fault": state.last_fault,
    }
    return row, int(check_code(state, path))


_STYLES = {"complete": "green", "faulted": "red", "unreadable": "red", "not whole": "red", "holding": "bold yellow"}


def _show(rows: list[dict[str, Any]]) -> None:
    table = Table("run file", "state", "points", "bench time", "left", "last record (UTC)", box=None, pad_edge=False)
    for row in rows:
        style = _STYLES.get(row["state"], "bold" if row.get("running") else "yellow")
        state = f"[{style}]{escape(row['state'])}[/]"
        if row["state"] in ("unreadable", "not whole"):
            table.add_row(escape(row["run_file"]), state)
            err.print(f"[red]{escape(row['message'])}[/]", soft_wrap=True)
            continue
        mark = " [magenta]SIM[/]" if row["simulated"] else ""
        left = "" if row["remaining_s"] is None else duration(row["remaining_s"])
        last = row["last_record_utc"][:16].replace("T", " ")
        points = f"{row['done']}/{row['points']}"
        table.add_row(escape(row["run_file"]) + mark, state, points, duration(row["elapsed_s"]), left, last)
    # Not wrapped, so that grep and cut find one line per run.
    print_whole(table, out if out.is_terminal else type(out)(highlight=False, width=10_000))
