"""The state that a running controller reports between commits, and requests to hold, release or stop, or that a
step by hand is done.

`RUN.live` is a small JSON file, replaced atomically at most once a second; it is a report, not a record. `RUN.request`
is written by `rig hold|release|stop|done` and acknowledged in `RUN.live`. A request for an earlier session is
ignored, so that last night's stop cannot stop tonight's run.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import secrets
import stat
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rig.files.regular import real_path
from rig.files.temporary import sweep, temporary_in
from rig.procedures.column_names import spelled, unit_of
from rig.procedures.plan.run_list import Factor
from rig.procedures.present.shell import shell_word
from rig.run_file.bodies import COUNT, NUMBER

VERBS = ("hold", "release", "stop", "done")


def live_path(run: Path) -> Path:
    """Path of the live state of a run file."""
    return real_path(run).with_suffix(".live")


def request_path(run: Path) -> Path:
    """Path of requests to the controller of a run file."""
    return real_path(run).with_suffix(".request")


def replace_json(path: Path, content: Mapping[str, Any]) -> None:
    """Replace a small JSON file atomically: readers see the old or the new one, never a part."""
    temporary = temporary_in(path.parent)
    try:
        with open(temporary, "wb") as file:
            file.write(json.dumps(content).encode() + b"\n")
        os.replace(temporary, path)
    except OSError:
        with contextlib.suppress(OSError):
            os.unlink(temporary)
        raise


def read_json(path: Path) -> dict[str, Any] | None:
    """The object in a small JSON file; None if it is missing or no object. Never blocks, as opening a pipe would."""
    try:
        with open(os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK), "rb") as file:
            if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
                return None
            content = json.loads(file.read(_MOST_BYTES))
    except (OSError, ValueError, RecursionError):
        return None
    return content if isinstance(content, dict) else None


_LONGEST = 200
"""Characters of a name or a value in a request; chosen."""
_MOST_BYTES = 1_000_000  # the file has a few hundred bytes


def read_live(run: Path) -> dict[str, Any] | None:
    """The live state of a run's controller, if one is running.

    If the live state is missing or invalid (a full disk), the controller still runs: the state is then "running".
    """
    if not controller_alive(run):
        return None
    live = read_json(live_path(run)) or {}
    elapsed_s, remaining_s = live.get("elapsed_s"), live.get("remaining_s")
    if not isinstance(live.get("state"), str) or not NUMBER.holds(elapsed_s):
        return {"state": "running", "detail": "a controller is running, and what it says cannot be read"}
    return {**live, "remaining_s": remaining_s if NUMBER.holds(remaining_s) else None}


def silent_s(run: Path, utc_s: float) -> float:
    """Age of the controller's last report at `utc_s`, seconds; 0 if unknown."""
    try:
        return max(0.0, utc_s - live_path(run).stat().st_mtime)
    except OSError:
        return 0.0


@dataclass(frozen=True)
class WaitingStep:
    """The step by hand that a run waits for, as its controller reports it.

    Attributes:
        step: its ordinal, from 1.
        of: number of steps.
        say: what the person has to do.
        value: name with unit of the number that the person has to state; "" for none.
    """

    step: int
    of: int
    say: str
    value: str


def asked_by_hand(live: Mapping[str, Any]) -> WaitingStep | None:
    """The step by hand that a live state tells of; None if there is none, or it makes no sense."""
    told = live.get("asked")
    if not isinstance(told, Mapping):
        return None
    step, of, say, value = (told.get(name) for name in ("step", "of", "say", "value"))
    if not (type(step) is int and type(of) is int and isinstance(say, str) and isinstance(value, str)):
        return None
    return WaitingStep(step, of, say, value)


def done_command(run: Path | str, value: str) -> str:
    """The command that says that a step by hand is done; `value` is the name of the number to be stated, "" for none.

    It can be typed as it is, but for V.
    """
    return f"rig done {shell_word(run)}{' --value V' if value else ''}"


def number(value: object) -> float | None:
    """A finite number, or None."""
    return float(value) if NUMBER.holds(value) else None  # type: ignore[arg-type]


def settling_now(live: Mapping[str, Any], factors: Sequence[Factor]) -> list[dict[str, Any]]:
    """The quantities that are settling: name, unit, instrument (`by`), target, band, outcome, seconds waited (`for_s`),
    samples as [seconds ago, value].
    """
    given, found = live.get("settling"), []
    units = {f.axis: spelled(unit_of(f.name)) for f in factors}
    for name, one in given.items() if isinstance(given, Mapping) else ():
        try:
            samples = [[float(t), float(value)] for t, value in one["samples"]]
            shown = {"target": float(one["target"]), "band": float(one["band"]), "outcome": str(one["outcome"])}
            shown |= {"by": str(one.get("by", "")), "for_s": number(one.get("for_s"))}
        except (KeyError, TypeError, ValueError):
            continue
        found.append(
            {"name": str(name).removesuffix("_degC"), "unit": units.get(name, "degC"), **shown, "samples": samples}
        )
    return found


class LiveState:
    """Writes `RUN.live`, at most once a second. A failure to write it never disturbs a run."""

    def __init__(self, run: Path, stopwatch: Callable[[], float]) -> None:
        self._path = live_path(run)
        self._stopwatch = stopwatch
        self._written = -1e9
        sweep(self._path.parent)

    def publish(self, content: Callable[[], Mapping[str, Any]], *, now: bool = False) -> None:
        """Write what `content` returns, unless less than a second has passed and it is not urgent."""
        moment = self._stopwatch()
        if not now and moment - self._written < 1.0:
            return
        self._written = moment
        with contextlib.suppress(OSError):
            replace_json(self._path, content())

    def remove(self) -> None:
        """Remove the file at the end of a session."""
        with contextlib.suppress(OSError):
            self._path.unlink(missing_ok=True)


@dataclass(frozen=True)
class Request:
    """A request of a person.

    Attributes:
        request_id: its id.
        verb: one of `VERBS`.
        step: "done": ordinal of the step by hand, from 1; 0 if not given.
        value: "done": the stated value, as text; None if none was stated.
        who: "done": name of the person; "" if unknown.
    """

    request_id: str
    verb: str
    step: int = 0
    value: str | None = None
    who: str = ""


class Requests:
    """Looks for requests to this session, at most ten times a second of real time."""

    def __init__(self, run: Path, session: int, stopwatch: Callable[[], float]) -> None:
        self._path = request_path(run)
        self._session = session
        self._stopwatch = stopwatch
        self._looked = -1e9
        self._seen = ""
        with contextlib.suppress(OSError):
            self._path.unlink(missing_ok=True)  # for an earlier session

    def poll(self) -> Request | None:
        """A new request, once; None if there is none."""
        moment = self._stopwatch()
        if moment - self._looked < 0.1:
            return None
        self._looked = moment
        if not os.access(self._path, os.F_OK):
            return None
        content = read_json(self._path)
        request_id = (content or {}).get("id")
        with contextlib.suppress(OSError):
            self._path.unlink(missing_ok=True)
        if content is None or not isinstance(request_id, str) or request_id == self._seen:
            return None
        if content.get("session") != self._session:
            return None
        self._seen = request_id
        verb = str(content.get("verb"))
        if verb not in VERBS:
            return None
        step, value, who = (content.get(name) for name in ("step", "value", "who"))
        return Request(
            self._seen,
            verb,
            int(step) if COUNT.holds(step) and step is not None else 0,
            None if value is None else str(value)[:_LONGEST],
            who if isinstance(who, str) and who.isprintable() and len(who) <= _LONGEST else "",
        )


def send_request(run: Path, verb: str, **more: Any) -> str | None:
    """Send a request to the controller of a run; returns the request's id, None if no controller is running.

    `more` are further values of the request, see `Request`.

    Raises:
        FileExistsError: another request has not been read yet; try again in a moment.

    """
    live = read_json(live_path(run))
    if live is None or "session" not in live or not controller_alive(run):
        return None
    request_id = secrets.token_hex(8)
    request = request_path(run)
    sweep(request.parent)
    temporary = temporary_in(request.parent)
    content = {"id": request_id, "session": live["session"], "verb": verb, **more}
    try:
        temporary.write_text(json.dumps(content) + "\n", encoding="utf-8")
        os.link(temporary, request)  # unlike a rename, this cannot overwrite another request
    finally:
        temporary.unlink(missing_ok=True)
    return request_id


def controller_alive(run: Path) -> bool:
    """Whether a process holds the lock of a file, as a controller that of its run file. It ends with its process."""
    try:
        descriptor = os.open(run, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK)
    except OSError:
        return False
    try:
        # Shared: two programs that only ask do not take each other for a controller.
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except OSError:
        return True
    finally:
        os.close(descriptor)
    return False
