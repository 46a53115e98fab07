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

from rig.report.story import words
from rig.run_file.chain import Record, encode


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

    """

    kind: Kind
    level: str
    text: str
    utc_s: float
    elapsed_s: float | None = None
    data: Mapping[str, Any] = field(default_factory=dict)
    unsafe: bool = False


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
    """What a record of the run file tells; None for what belongs to the ordinary course of a point.

    Args:
        record: as it was written.
        after_crash: the session before this one ended without a word.

    """
    if record.kind == "end" or (record.kind, record.status) in (("event", "preparing"), ("event", NOT_NOTIFIED)):
        return None  # told as the session's end, as a change of state, and when it happened
    kind, level, text = _told(record, after_crash)
    if not text:
        return None
    place = {"point": record.run_index, "whole_plot": record.whole_plot, "attempt": record.attempt}
    about = {k: v for k, v in place.items() if v is not None}
    data = {"record": record.kind, "status": record.status, "session": record.session, **about, "body": _short(record)}
    return Happening(kind, level, one_line(text), record.utc_s, record.elapsed_s, data)


def _told(record: Record, after_crash: bool) -> tuple[Kind, str, str]:
    text = _words(record)
    match record.kind:
        case "session" if after_crash and record.session > 1:
            return Kind.CRASH, "warning", f"{text}; the one before ended without a word (power cut, crash or kill)"
        case "session":
            return Kind.START, "info", text
        case "hold":
            return Kind.HOLD, "warning", text
        case "fault" if record.status == "abort":
            return Kind.EVENT, "error", text  # the session's end, which follows, tells people
        case "fault":
            return Kind.FAULT, "warning", text
        case "skip":
            return (Kind.WARNING if record.status == "final" else Kind.EVENT), "warning", text
        case "event" if record.status in ("whole-plot-lost", "hole"):
            return Kind.WARNING, "warning", text
        case "event" if record.status == "warning":
            text = _message(record.data, encode(record.data)[:300])
            return Kind.WARNING, "warning", f"early warning: {text}"
        case "event" if record.status == "safe" and record.data.get("unsafe"):
            return Kind.EVENT, "error", text
        case "event" if not text:
            said = _message(record.data, "")
            name = str(record.status or "").replace("-", " ")
            return Kind.EVENT, "info", f"{name}: {said}" if said else name
        case _:
            return Kind.EVENT, "info", text


def _words(record: Record) -> str:
    """A record as the story tells it; one that the story cannot tell is told plainly, for people wait for it."""
    try:
        return words(record)
    except (LookupError, TypeError, ValueError):
        name = " ".join(part for part in (record.kind, record.status) if part)
        return f"{name}: {_message(record.data, encode(record.data)[:300])}"


NOT_NOTIFIED = "not-notified"
"""Status of the event that says that somebody could not be told of something."""


def _message(data: Mapping[str, Any], otherwise: str) -> str:
    """The sentence that an event brings with it, under whichever of these names."""
    found = (data[key] for key in ("message", "text", "what", "why", "reason", "cause") if key in data)
    return next((text for text in found if isinstance(text, str) and text), otherwise)


def _short(record: Record) -> Any:
    """A record's body for a log, or where to find it if it is long: evidence belongs to the run file."""
    return record.data if len(record.body) <= 2000 else f"{len(record.body)} characters, see the run file"
