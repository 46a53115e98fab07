"""What a session (one start of the controller on a run) is told, and what it says."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, Protocol

from rig.run_file.chain import Record
from rig.run_file.events.event import Event


class Outcome(Enum):
    """How a session ended."""

    COMPLETE = "complete"
    STOPPED = "stopped"
    INTERRUPTED = "interrupted"
    FAULT = "fault"
    UNSAFE = "fault, and not everything is in its safe state"


@dataclass(frozen=True)
class Progress:
    """News for whoever watches.

    Attributes:
        state: where the sequencer is.
        done: points with an accepted observation or given up for good.
        total: points of the run.
        elapsed_s: bench seconds since the run was created.
        remaining_s: bench seconds the rest is expected to take, None while that cannot be said.
        message: what is going on, "" if the state says it.
        detail: readings of the moment that go with it, "" if there are none.

    """

    state: str
    done: int
    total: int
    elapsed_s: float
    remaining_s: float | None
    message: str
    detail: str = ""


class Observer(Protocol):
    """Who is told of every record as it is written: the log, notifications. It never raises and never waits."""

    def recorded(self, record: Record) -> None:
        """A record was appended; one that becomes durable with the next may be told before it is."""
        ...

    def to_note(self) -> Sequence[Event]:
        """Events that the observer wants in the run file; each is handed out once."""
        ...


class Nobody:
    """An observer for runs that nobody observes."""

    def recorded(self, record: Record) -> None:
        """See `Observer.recorded`."""

    def to_note(self) -> Sequence[Event]:
        """See `Observer.to_note`."""
        return ()


@dataclass
class Session:
    """One start of the controller on a run.

    Attributes:
        elapsed_origin: clock reading at which the run's elapsed time was zero.
        number: from 1.
        gap_certain: False if the gap was bridged by UTC across a reboot.
        gap_known: False if UTC cannot be right; the gap counts as nothing then.
        accept: names of instruments that may be other ones than before.
        about: what the session record keeps besides (process, host, versions).
        observer: is told of every record.

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
    """Set from a signal handler, looked at wherever the sequencer waits."""

    interrupt: str = ""
