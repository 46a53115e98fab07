"""What happens during a session, as people and logs are told it: one happening, one line of plain words."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from enum import StrEnum
from pathlib import Path
from typing import Any
from unicodedata import category

from rig.run_file.chain import Record
from rig.run_file.events.event import Event
from rig.run_file.events.sessions import SessionBegan


class Kind(StrEnum):
    """What sort of thing happened. The first ten are what `notify.toml` may list under `on`."""

    START = "start"
    CRASH = "crash"
    HOLD = "hold"
    FAULT = "fault"
    WARNING = "warning"
    ENDED_BY_FAULT = "ended-by-fault"
    STOP = "stop"
    INTERRUPT = "interrupt"
    FINISH = "finish"
    TEST = "test"
    STATE = "state"
    PROGRESS = "progress"
    EVENT = "event"
    LOG = "log"


@dataclass(frozen=True)
class RunFacts:
    """Which run it is.

    Attributes:
        path: the run file, None while there is none yet.
        run_id: its name, "" while there is none yet.
        bench: the bench's name.
        procedure: the procedure's name.
        simulated: no real instrument involved.
        after_crash: the session before ended without a word (power cut, SIGKILL).
        served: systemd started this session and starts it again after a fault.

    """

    path: Path | None
    run_id: str
    bench: str
    procedure: str
    simulated: bool
    after_crash: bool = False
    served: bool = False


@dataclass(frozen=True)
class Happening:
    """One thing that happened.

    Attributes:
        kind: what sort of thing.
        level: "info", "warning" or "error".
        text: one line of plain words.
        utc_s: seconds since 1970-01-01, bench time.
        elapsed_s: bench seconds since the run was created, None where there is no run.
        data: what else is known, for logs that programs read.
        unsafe: not everything is in its safe state: somebody has to go there.
        event: of the run file, if it is one.

    """

    kind: Kind
    level: str
    text: str
    utc_s: float
    elapsed_s: float | None = None
    data: Mapping[str, Any] = field(default_factory=dict)
    unsafe: bool = False
    event: Event | None = None


_CONTROLS = frozenset({"Cc", "Cf", "Cs", "Zl", "Zp"})
"""Unicode's categories of what makes a new line, moves a cursor, or turns the order of letters."""


def one_line(text: str) -> str:
    """Text without line ends and control characters, which instruments, names, servers and notes may hold."""
    marked = "".join("\0" if category(c) in _CONTROLS else c for c in text.replace("\n", "; "))
    return re.sub("\0+", " ", marked).strip()


def utc_text(utc_s: float) -> str:
    """2026-01-15T02:13:07.250Z."""
    return f"{datetime.fromtimestamp(utc_s, UTC):%Y-%m-%dT%H:%M:%S}.{int(utc_s * 1000) % 1000:03d}Z"


def from_record(record: Record, *, after_crash: bool) -> Happening | None:
    """What a record of the run file tells logs and people; None for what they are not told, or in another way.

    Args:
        record: as it was written.
        after_crash: the session before this one ended without a word.

    """
    if record.accepted or not record.event.importance.level:
        return None
    event, text = record.event, record.sentence()
    kind, level = Kind(event.importance.message), event.importance.level
    if isinstance(event, SessionBegan) and after_crash and record.session > 1:
        kind, level = Kind.CRASH, "warning"
        text += "; the one before ended without a word (power cut, crash or kill)"
    place = {"point": record.run_index, "whole_plot": record.whole_plot, "attempt": record.attempt}
    about = {k: v for k, v in place.items() if v is not None}
    data = {"record": record.kind, "status": record.status, "session": record.session, **about, "body": _short(record)}
    return Happening(kind, level, one_line(text), record.utc_s, record.elapsed_s, data, event=event)


def _short(record: Record) -> Any:
    """A record's body for a log, or where to find it if it is long: evidence belongs to the run file."""
    return record.data if len(record.body) <= 2000 else f"{len(record.body)} characters, see the run file"
