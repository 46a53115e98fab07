"""The log of a session: one line per event, as text or as JSON, in UTC.

The run file is the record; a log is for people and for tools that collect lines. It never ends a run: lines are
written by a separate thread. A full disk, a missing folder or a network drive that hangs costs lines and nothing else.
Every line opens the file again, so that it can be rotated at any time.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Literal

from rig.files.regular import real_path
from rig.unattended.happenings import Happening, RunFacts, utc_text
from rig.unattended.worker import Worker

LogFormat = Literal["text", "json"]
Formatter = Callable[[Happening, RunFacts], str]

_WAITING = 10_000
_CLOSE_S = 5.0
_PRIORITY = {"info": 6, "warning": 4, "error": 3}


def default_log(run: Path) -> Path:
    """Default path of a run's log: beside the run file."""
    return real_path(run).with_suffix(".log")


def as_text(happening: Happening, facts: RunFacts) -> str:
    """2026-01-15T02:13:07.250Z warning SIMULATED night-1a2b: held at point 17: ..."""
    run = facts.run_id or facts.procedure
    mark = "SIMULATED " if facts.simulated else ""
    return f"{utc_text(happening.utc_s)} {happening.level:<7} {mark}{run}: {happening.text}"


def as_json(happening: Happening, facts: RunFacts) -> str:
    """One JSON object; keys `utc`, `level`, `event`, `text`, `run`, `bench`, `procedure`, `simulated`, `elapsed_s`."""
    line = {
        "utc": utc_text(happening.utc_s),
        "level": happening.level,
        "event": happening.kind.value,
        "text": happening.text,
        "run": facts.run_id,
        "bench": facts.bench,
        "procedure": facts.procedure,
        "simulated": facts.simulated,
        "elapsed_s": None if happening.elapsed_s is None else round(happening.elapsed_s, 3),
        **{key: value for key, value in happening.data.items() if value is not None},
    }
    return json.dumps(line, ensure_ascii=False, default=str)


FORMATS: dict[LogFormat, Formatter] = {"text": as_text, "json": as_json}


_ADD = os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC | os.O_NONBLOCK  # opening a pipe may block for ever


def file_writer(path: Path) -> Callable[[str], None]:
    """A function that appends a line to a file, in one write; it raises OSError."""

    def write(line: str) -> None:
        descriptor = os.open(path, _ADD, 0o644)
        try:
            os.write(descriptor, line.encode("utf-8", "backslashreplace") + b"\n")
        finally:
            os.close(descriptor)

    return write


def stderr_writer() -> Callable[[str], None]:
    """A function that prints a line on stderr; it raises OSError."""

    def write(line: str) -> None:
        print(line, file=sys.stderr, flush=True)

    return write


class Log:
    """Writes reports as lines; a listener of a session.

    Args:
        write: writes a line; after an OSError this line is lost.
        form: "text" or "json".
        journal: start every line with systemd's priority (`<4>`).
        on_stderr: whether the lines go to stderr, where progress would be shown.

    Attributes:
        lost: number of lines that could not be written.

    """

    def __init__(
        self,
        write: Callable[[str], None],
        form: LogFormat = "text",
        *,
        journal: bool = False,
        on_stderr: bool = False,
    ) -> None:
        self.lost = 0
        self.on_stderr = on_stderr
        self._write = write
        self._form = FORMATS[form]
        self._journal = journal
        self._untold = 0
        self._worker: Worker[tuple[Happening, RunFacts]] = Worker("log", self._line, _WAITING)

    def happened(self, happening: Happening, facts: RunFacts) -> None:
        """Queue a line."""
        if not self._worker.put((happening, facts)):
            self.lost += 1
            self._untold += 1

    def close(self) -> None:
        """Write queued lines, for a few seconds at most."""
        self.lost += len(self._worker.close(_CLOSE_S))

    def _line(self, item: tuple[Happening, RunFacts]) -> None:
        happening, facts = item
        prefix = f"<{_PRIORITY[happening.level]}>" if self._journal else ""
        gap = f" ({self._untold} line(s) before this one could not be written)" if self._untold else ""
        if gap:
            happening = Happening(
                happening.kind,
                happening.level,
                happening.text + gap,
                happening.utc_s,
                happening.elapsed_s,
                happening.data,
            )
        try:
            self._write(prefix + self._form(happening, facts))
        except (OSError, ValueError):  # ValueError: a stream that has been closed
            self.lost += 1
            self._untold += 1
        else:
            self._untold = 0


def logged_by_journal() -> bool:
    """Whether stderr is connected to systemd's journal, which accepts lines with priorities."""
    stream = os.environ.get("JOURNAL_STREAM", "")
    try:
        found = os.fstat(2)
    except OSError:
        return False
    return stream == f"{found.st_dev}:{found.st_ino}"
