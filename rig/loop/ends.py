"""Ends of a loop's runs, and of its sessions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from rig.engine.session import Outcome
from rig.errors import BenchFault
from rig.loop.program import LoopRun, Program
from rig.run_file.chain import Record
from rig.run_file.events.loops import LoopRunEnded
from rig.run_file.read.reader import RunReader
from rig.run_file.state.state import read_state
from rig.runs.controller import Result


class Told(Protocol):
    """Receives what a loop does, for terminal, log and messages."""

    def run_begins(self, path: Path) -> None:
        """A run's file exists, or goes on."""

    def says(self, record: Record) -> None:
        """A record of the loop was written."""


@dataclass(frozen=True)
class Ending:
    """The end of a session of a loop.

    Attributes:
        program: state of the loop.
        outcome: "complete" once it is closed; otherwise how its open run ended, and the loop can be resumed.
        message: the reason, "" if none is needed.
        head: hash of the last record of the program file.
        unsafe: whether some instrument is not known to be in its safe state.
    """

    program: Program
    outcome: Outcome
    message: str = ""
    head: str = ""
    unsafe: bool = False


def each_h(runs: Sequence[LoopRun], replications: int) -> float:
    """Expected bench time of one more replication, hours."""
    took = [run.ended.took_s for run in runs[1:] if run.ended is not None and run.complete]
    first = runs[0].ended
    assert first is not None  # it is complete before the first look
    return (max(took) if took else first.took_s / replications) / 3600.0


def ended(run: LoopRun, result: Result) -> LoopRunEnded:
    """The record of the end of a run."""
    state = result.state
    return LoopRunEnded(
        number=run.planned.number,
        how=result.outcome.value,
        head=result.head,
        accepted=len(state.accepted),
        points=state.points,
        took_s=round(state.elapsed_s, 3),
        message="" if result.outcome is Outcome.COMPLETE else result.message,
    )


def not_made(path: Path, run: LoopRun, error: BenchFault) -> LoopRunEnded:
    """A run whose bench could not be opened."""
    head, took_s, accepted, points = "", 0.0, 0, 0
    if path.exists():
        with RunReader.open(path) as reader:
            state, head = read_state(reader), reader.head()[1].hex()
            took_s, accepted, points = state.elapsed_s, len(state.accepted), state.points
    return LoopRunEnded(
        number=run.planned.number,
        how=Outcome.FAULT.value,
        head=head,
        accepted=accepted,
        points=points,
        took_s=took_s,
        message=str(error),
    )
