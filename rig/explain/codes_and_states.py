"""Exit codes, and states of a run."""

from __future__ import annotations

from rig.engine.states import MEANING, TRANSITIONS
from rig.errors import ExitCode
from rig.procedures.present.markdown import table


def exit_codes() -> str:
    """The table of exit codes."""
    return table(("code", "meaning", "what to do"), ((str(code.value), code.meaning, code.next) for code in ExitCode))


def states() -> str:
    """Tables of states and of triggers."""
    moves = ((t.trigger, ", ".join(t.sources), t.target, t.when) for t in TRANSITIONS)
    return f"{table(('state', 'meaning'), MEANING.items())}\n{table(('trigger', 'from', 'to', 'when'), moves)}"
