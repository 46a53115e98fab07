"""Inputs and outputs of a session, which is one start of the controller on a run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, NamedTuple, Protocol

from rig.run_file.chain import Record
from rig.run_file.events.event import Event


class Outcome(Enum):
    """How a session ended."""

    COMPLETE = "complete"
    STOPPED = "stopped"
    INTERRUPTED = "interrupted"
    FAULT = "fault"
    UNSAFE = "fault, and not everything is in its safe state"


class Progress(NamedTuple):
    """Progress, for observers.

    Attributes:
        state: where the sequencer is.
        done: points with an accepted observation or given up for good.
        total: points of the run.
        elapsed_s: bench seconds since the run was created.
        remaining_s: estimate of the remaining bench seconds, None if unknown.
        message: the present activity, "" if the state says it.
        detail: present readings that belong to the message, "" if none.

    """

    state: str
    done: int
    total: int
    elapsed_s: float
    remaining_s: float | None
    message: str
    detail: str = ""


class Observer(Protocol):
    """Receives every record as it is written: the log, notifications. It never raises and never waits."""

    def recorded(self, record: Record) -> None:
        """A record was appended. A record that becomes durable with the next one may be reported before that."""
        ...

    def to_note(self) -> Sequence[Event]:
        """Events that the observer wants in the run file; each is returned once."""
        ...


class Nobody:
    """An observer that does nothing."""

    def recorded(self, record: Record) -> None:
        """A record was appended."""

    def to_note(self) -> Sequence[Event]:
        """Events that the observer wants in the run file; each is returned once."""
        return ()


@dataclass
class Session:
    """One start of the controller on a run.

    Attributes:
        elapsed_origin: clock reading at which the run's elapsed time was zero.
        number: from 1.
        gap_certain: False if the gap was bridged by UTC across a reboot.
        gap_known: False if UTC cannot be right; the gap counts as nothing then.
        accept: names of instruments that may have been exchanged.
        about: further fields of the session record (process, host, versions).
        observer: receives every record.

    """

    elapsed_origin: float
    number: int
    gap_certain: bool
    accept: frozenset[str]
    about: Mapping[str, Any]
    observer: Observer = field(default_factory=Nobody)
    gap_known: bool = True


@dataclass
class Signals:
    """Set by a signal handler, checked wherever the sequencer waits."""

    interrupt: str = ""
