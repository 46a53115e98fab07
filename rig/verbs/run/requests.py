"""Requests to a running controller, through the request file beside its run file."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Any

from rig.drivers.clock import RealClock
from rig.errors import RigError, UsageError
from rig.procedures.present.shell import shell_word
from rig.run_file.live import controller_alive, live_path, read_json, send_request
from rig.run_file.read.reader import RunReader
from rig.run_file.state.state import read_state

_GIVE_UP_S = 30.0


def ask(run_file: Path, verb: str, **more: Any) -> str:
    """Ask the controller of a run, and wait until it has seen it.

    Args:
        run_file: the run file.
        verb: "hold", "release", "stop" or "done".
        more: further values, see `rig.run_file.live.Request`.

    Returns:
        What happened, a sentence.

    Raises:
        UsageError: there is no controller, or it refuses.
        RigError: it did not answer within 30 s, or ended.
    """
    if not run_file.is_file():
        raise UsageError(f"there is no run file {run_file}")
    clock = RealClock()
    give_up = clock.now() + _GIVE_UP_S
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
    return f"{verb}: acknowledged"


def _ended(run_file: Path, verb: str) -> str:
    """What happened if the controller ended before it acknowledged."""
    with RunReader.open(run_file) as reader:
        state = read_state(reader)
    how = state.ended or state.rested
    if verb == "stop" and how in ("stopped", "complete"):
        return f"{verb}: the run is {how}"
    raise RigError(
        f"the controller ended before {verb}: the run is {how}; `rig status {shell_word(run_file)}` says more"
    )
