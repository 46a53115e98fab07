"""The runs shown by the page: one, or all of a folder, newest first."""

from __future__ import annotations

import os
import re
import threading
from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

from rig.errors import RigError
from rig.files.regular import real_path
from rig.procedures.plan.expected import Previous
from rig.run_file.live import controller_alive, live_path, read_json
from rig.watch.feed import RunFeed
from rig.watch.reading import WatchReader

_LISTED = 200
_TICK_S = 2.0
"""Resolution of a file's time of change, seconds: within it a file is read again."""


@dataclass(frozen=True)
class Entry:
    """One run in the list.

    Attributes:
        name: name of the file, without its ending.
        procedure: its name; "" if the file cannot be read.
        bench: its name.
        state: in one or two words.
        running: whether a controller has it.
        done: number of observed points.
        points: number of all points.
        began_utc_s: time of its creation.
        simulated: whether no real instrument is involved.
        problem: why it cannot be read, "" if it can.
    """

    name: str
    procedure: str = ""
    bench: str = ""
    state: str = ""
    running: bool = False
    done: int = 0
    points: int = 0
    began_utc_s: float = 0.0
    simulated: bool = False
    problem: str = ""


class Shelf:
    """Run files by name.

    Args:
        where: a run file, or a folder of them; or a function that returns run files by name, the newest first.
        reference: a previous calibration to compare observations with.
        stopwatch: real seconds.
        utc: real seconds since 1970-01-01.
    """

    def __init__(
        self,
        where: Path | Callable[[], dict[str, Path]],
        reference: Previous | None,
        stopwatch: Callable[[], float],
        utc: Callable[[], float],
    ) -> None:
        self._where, self._reference = where, reference
        self._stopwatch, self._utc = stopwatch, utc
        self._feeds: dict[str, RunFeed] = {}
        self._known: dict[str, tuple[float, Entry]] = {}
        self._lock = threading.Lock()

    @property
    def only(self) -> str | None:
        """The run's name if there is only one."""
        return None if callable(self._where) or self._where.is_dir() else _name_of(self._where)

    def feed(self, name: str) -> RunFeed | None:
        """The run of that name; None if there is none. Names are looked up and never used as paths."""
        path = self._paths().get(name)
        if path is None:
            return None
        with self._lock:
            if name not in self._feeds:
                self._feeds[name] = RunFeed(path, self._reference, self._stopwatch, self._utc)
            return self._feeds[name]

    def entries(self) -> list[Entry]:
        """The runs, newest first; a file that is unchanged is not read again."""
        found = []
        for name, path in self._paths().items():
            changed = _changed(path)
            known = self._known.get(name)
            if known is None or known[0] != changed or self._utc() - changed < _TICK_S:
                known = (changed, _entry(name, path))
                self._known[name] = known
            found.append((_made(name, changed), _now(known[1], path)))
        return [entry for _, entry in sorted(found, key=lambda one: (one[0], one[1].name), reverse=True)]

    def _paths(self) -> dict[str, Path]:
        if callable(self._where):
            return self._where()
        if not self._where.is_dir():
            return {_name_of(self._where): self._where}
        paths = sorted(self._where.glob("*.sqlite"), key=_changed, reverse=True)[:_LISTED]
        return {_name_of(path): path for path in paths}


def _name_of(path: Path) -> str:
    """Name of a run on the page and in its address; bytes of a file name that are not text are escaped."""
    return os.fsencode(path.stem).decode("utf-8", "backslashreplace")


def _made(name: str, changed: float) -> str:
    """Sort key by time of creation: the name, which begins with it; a dry run's clock has no real time."""
    if re.match(r"\d{8}T\d{6}", name):
        return name[:15]
    return datetime.fromtimestamp(changed, UTC).strftime("%Y%m%dT%H%M%S")


def _changed(path: Path) -> float:
    times = []
    real = real_path(path)
    for one in (real, real.with_name(real.name + "-wal")):
        try:
            times.append(one.stat().st_mtime)
        except OSError:
            continue
    return max(times, default=0.0)


def _now(entry: Entry, path: Path) -> Entry:
    """An entry with what its controller says at this moment, if there is one."""
    live = read_json(live_path(path))
    if not live or not controller_alive(path):
        return entry
    return replace(entry, state=str(live.get("state", "running")), running=True)


def _entry(name: str, path: Path) -> Entry:
    """An entry by the records of its file."""
    try:
        with WatchReader.open(path) as reader:
            run, began = reader.about(), reader.genesis().utc_s
            done, ended = reader.accepted(), reader.ended()
        return Entry(
            name,
            run.procedure or "",
            run.bench or "",
            ended or "not running",
            False,
            done,
            run.points,
            began,
            run.simulated,
        )
    except RigError as error:
        return Entry(name, problem=str(error))
    except OSError as error:
        return Entry(name, problem=f"it cannot be read: {error.strerror}")
