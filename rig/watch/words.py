"""The state of a running controller in words for the page. `RUN.live` is a file like any other, and is not trusted."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rig.procedures.present.shell import shell_word
from rig.run_file.live import asked_by_hand, done_command, number
from rig.run_file.state.state import RunState

_DOING = {
    "ready": "starting",
    "checking": "checking instruments",
    "preparing": "preparing",
    "recovering": "planning the path to the next point",
    "moving": "moving",
    "settling": "settling",
    "measuring": "reading the sensors",
    "recording": "recording",
    "holding": "on hold",
    "parking": "parking",
    "done": "done",
    "faulted": "fault; the bench was brought to its safe state",
}
_RESTED = {
    "created": "created, never run",
    "interrupted": "interrupted",
    "stopped": "stopped",
    "faulted": "stopped by a fault",
}


def state_now(fold: RunState, live: Mapping[str, Any], running: bool, path: Path) -> dict[str, str]:
    """Word, sentence, tone ("good", "busy", "hold", "bad") and the next command for a person.

    Args:
        fold: state of the run by its file.
        live: state by a running controller; {} if there is none.
        running: whether a controller is running.
        path: the run file, for commands to type.
    """
    file = shell_word(path)
    if running:
        state = str(live.get("state", ""))
        said = " ".join(str(live.get(key) or "") for key in ("message", "detail")).strip()
        point = number(live.get("point"))
        said = said or ("" if point is None else f"point {point:.0f}")
        tone = {"holding": "hold", "faulted": "bad"}.get(state, "busy")
        asked = asked_by_hand(live) if state == "holding" else None
        todo = f"rig release {file}" if state == "holding" else ""
        doing = _DOING.get(state, state)
        if asked is not None:
            doing, todo = f"waits for a person: {asked.say}", done_command(path, asked.value)
            said = said.rpartition("`")[2].lstrip(", ")  # what follows the command, which is shown by itself
        return {"word": state, "doing": doing, "said": said, "tone": tone, "todo": todo}
    if fold.ended is not None:
        return {"word": fold.ended, "doing": fold.ended, "said": "", "tone": "good", "todo": ""}
    return {
        "word": fold.rested,
        "doing": _RESTED.get(fold.rested, fold.rested),
        "said": "No controller is running on this run file.",
        "tone": "hold" if fold.rested == "stopped" else "bad",
        "todo": f"rig resume {file}",
    }


def expected_end(live: Mapping[str, Any]) -> float | None:
    """Expected end of the run by the bench's clock, seconds since 1970-01-01."""
    now, left = number(live.get("utc_s")), number(live.get("remaining_s"))
    return None if now is None or left is None else now + left
