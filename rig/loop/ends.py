"""Ends of a loop's runs, and of its sessions."""

from __future__ import annotations

import os
import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from rig.engine.session import Outcome
from rig.errors import BenchFault
from rig.loop.program import LoopRun, Program
from rig.loop.timeline import Timeline
from rig.run_file.chain import Record
from rig.run_file.events.event import EMPTY
from rig.run_file.events.loops import LoopRunEnded
from rig.run_file.events.sessions import SessionBegan
from rig.run_file.read.reader import RunReader
from rig.run_file.state.state import read_state
from rig.run_file.wal import WalState
from rig.runs.controller import Result
from rig.runs.plans import Plan
from rig.version import versions
from rig.who import Operator


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


def began(plan: Plan, timeline: Timeline, program: Program, dropped: WalState, by: Operator) -> SessionBegan:
    """The record of the begin of a session.

    Args:
        plan: of the first run.
        timeline: time of the loop.
        program: state of the loop.
        dropped: what was lost of its file.
        by: operator.
    """
    gap, elapsed_s = timeline.gap, timeline.elapsed_s
    about: Mapping[str, Any] = {
        **by.as_json(),
        "simulated": plan.dry or plan.bench.simulated,
        "pid": os.getpid(),
        "host": platform.node(),
        "boot": timeline.boot,
        "software": versions(one.driver for one in plan.bench.instruments.values()),
    }
    return SessionBegan(
        **about,
        clock_s=timeline.clock_s,
        elapsed_s=elapsed_s,
        gap_s=max(0.0, elapsed_s - program.run.elapsed_s),
        gap_certain=gap.certain,
        gap_known=gap.known,
        wal_frames_dropped=dropped.dropped,
        wal_commits_lost=dropped.lost_commits,
        wal_damage=dropped.damage,
    )


def each_h(runs: Sequence[LoopRun], replications: int) -> float:
    """Expected bench time of one more replication, hours."""
    took = [run.ended.took_s for run in runs if run.planned.segment and run.ended is not None and run.complete]
    first = runs[0].ended
    assert first is not None  # it is complete before the first look
    return (max(took) if took else first.took_s / replications) / 3600.0


def ended(run: LoopRun, result: Result, left_on: Sequence[str] = ()) -> LoopRunEnded:
    """The record of the end of a run; `left_on` for the next one."""
    state = result.state
    return LoopRunEnded(
        number=run.planned.number,
        how=result.outcome.value,
        head=result.head,
        accepted=len(state.accepted),
        points=state.points,
        took_s=round(state.elapsed_s, 3),
        message="" if result.outcome is Outcome.COMPLETE else result.message,
        left_on=tuple(left_on) or EMPTY,
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
