"""`rig status` of the program file of a loop."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from rig.cli.show import out, print_json
from rig.errors import ExitCode
from rig.loop import Program, blocks, open_program, to_json
from rig.procedures.present.terminal import show
from rig.run_file.live import controller_alive


def show_loop(path: Path, *, as_json: bool, check: bool) -> int:
    """Show a loop; returns the exit code."""
    program = open_program(path)
    if as_json:
        print_json(to_json(program))
    else:
        show(blocks(program), out)
    return _code_of_loop(program) if check else ExitCode.DONE


def _code_of_loop(program: Program) -> ExitCode:
    """Exit code for the state of a loop, as of a run."""
    if controller_alive(program.path):
        return ExitCode.RUNNING
    if program.closed is None:
        return ExitCode.INTERRUPTED
    return ExitCode.DONE if program.closed.settled and not program.closed.fault else ExitCode.OUTSIDE_ACCEPTANCE


def loop_row(path: Path) -> tuple[dict[str, Any], int]:
    """A loop's line in the list of a folder; its points are its runs."""
    program = open_program(path)
    running = controller_alive(program.path)
    state = "loop closed" if program.closed is not None else "loop at work" if running else "loop open"
    row = {
        "run_file": str(program.path),
        "state": state,
        "running": running,
        "simulated": program.run.simulated,
        "points": len(program.runs),
        "done": program.complete,
        "elapsed_s": program.run.elapsed_s,
        "remaining_s": None,
        "last_record_utc": datetime.fromtimestamp(program.run.utc_s, UTC).isoformat(timespec="seconds"),
    }
    return row, int(_code_of_loop(program))
