"""Reports of a session to people and logs: each is one line of plain words."""

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
    """Kinds of reports. `notify.toml` may list those down to `loop` under `on`."""

    START = "start"
    CRASH = "crash"
    HOLD = "hold"
    FAULT = "fault"
    WARNING = "warning"
    ENDED_BY_FAULT = "ended-by-fault"
    STOP = "stop"
    INTERRUPT = "interrupt"
    FINISH = "finish"
    LOOP = "loop"
    TEST = "test"
    DUE = "due"
    STATE = "state"
    PROGRESS = "progress"
    EVENT = "event"
    LOG = "log"


@dataclass(frozen=True)
class RunFacts:
    """Facts about the run.

    Attributes:
        path: the run file, None before it exists.
        run_id: its name, "" before it exists.
        bench: the bench's name.
        procedure: the procedure's name.
        simulated: whether no real instrument is involved.
        after_crash: whether the previous session ended without a record (power cut, SIGKILL).
        served: whether systemd started this session, and starts it again after a fault.

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
    """One report.

    Attributes:
        kind: kind of the report.
        level: "info", "warning" or "error".
        text: one line of plain words.
        utc_s: seconds since 1970-01-01, bench time.
        elapsed_s: bench seconds since the run was created, None without a run.
        data: further values, for logs that programs read.
        unsafe: whether something is not in its safe state, so that a person has to go there.
        event: event of the run file, if any.

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
"""Unicode categories of characters that start a new line, move the cursor, or change the direction of text."""


def one_line(text: str) -> str:
    """Text without line ends and control characters, which texts of instruments, servers and people may contain."""
    marked = "".join("\0" if category(c) in _CONTROLS else c for c in text.replace("\n", "; "))
    return re.sub("\0+", " ", marked).strip()


def utc_text(utc_s: float) -> str:
    """2026-01-15T02:13:07.250Z."""
    return f"{datetime.fromtimestamp(utc_s, UTC):%Y-%m-%dT%H:%M:%S}.{int(utc_s * 1000) % 1000:03d}Z"


def from_record(record: Record, *, after_crash: bool) -> Happening | None:
    """The report of a record of the run file; None for records without a report, or with another one.

    Args:
        record: the record.
        after_crash: whether the previous session ended without a record.

    """
    if record.accepted or not record.event.importance.level:
        return None
    event, text = record.event, record.sentence()
    kind, level = Kind(event.importance.message), event.importance.level
    if isinstance(event, SessionBegan) and after_crash and record.session > 1:
        kind, level = Kind.CRASH, "warning"
        text += "; the previous one ended without a record (power cut, crash or kill)"
    place = {"point": record.run_index, "whole_plot": record.whole_plot, "attempt": record.attempt}
    about = {k: v for k, v in place.items() if v is not None}
    data = {"record": record.kind, "status": record.status, "session": record.session, **about, "body": _short(record)}
    return Happening(kind, level, one_line(text), record.utc_s, record.elapsed_s, data, event=event)


def _short(record: Record) -> Any:
    """A record's body for a log; for a long body its place in the run file."""
    return record.data if len(record.body) <= 2000 else f"{len(record.body)} characters, see the run file"
