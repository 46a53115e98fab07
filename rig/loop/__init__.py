"""Loops: a run, further runs until what it found is confirmed or the time is over, and all that follows from them.

The public face: `start_loop`, `resume_loop`, `continue_loop`, and the state of a loop, `open_program`.
"""

from rig.loop.ends import Ending, Told
from rig.loop.program import SUFFIX, Program, open_program, run_at_work, stopped_run
from rig.loop.sessions import continue_loop, resume_loop, start_loop
from rig.loop.shown import blocks, to_json
from rig.loop.verified import findings_of_runs

__all__ = [
    "SUFFIX",
    "Ending",
    "Program",
    "Told",
    "blocks",
    "continue_loop",
    "findings_of_runs",
    "open_program",
    "resume_loop",
    "run_at_work",
    "start_loop",
    "stopped_run",
    "to_json",
]
