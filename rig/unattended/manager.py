"""Messages to systemd about a session: ready, alive, status, stopping. A small implementation of sd_notify(3).

`WATCHDOG=1` is sent only with the sequencer's own progress, so that a driver call that hangs is noticed although the
process is alive.
"""

from __future__ import annotations

import os
import socket
from collections.abc import Mapping
from pathlib import Path

from rig.drivers.clock import Clock, RealClock
from rig.engine.session import Progress
from rig.engine.states import State
from rig.procedures.present.durations import duration
from rig.run_file.events.bench import AsFound
from rig.unattended.happenings import Happening, RunFacts, one_line

_STATUS_S = 5.0


class ServiceManager:
    """Notifies the service manager; a listener of a session. Does nothing without a service manager.

    Args:
        environment: has `NOTIFY_SOCKET`, `WATCHDOG_USEC` and `WATCHDOG_PID`.
        clock: real time.

    """

    def __init__(self, environment: Mapping[str, str] | None = None, clock: Clock | None = None) -> None:
        env = os.environ if environment is None else environment
        self._clock = clock or RealClock()
        self._address = _address(env.get("NOTIFY_SOCKET", ""))
        self._watchdog_s = _watchdog_s(env)
        self.lasts = False
        self._ready = False
        self._stopping = False
        self._alive = self._told = float("-inf")
        self._status = ""
        self._unsent: list[str] = []

    @property
    def present(self) -> bool:
        """Whether there is a service manager."""
        return self._address is not None

    def progress(self, news: Progress) -> None:
        """Report that the sequencer is alive, and its status, at half the watchdog's time or more often."""
        if self._address is None:
            return
        now = self._clock.now()
        lines = []
        alive = self._watchdog_s > 0 and now - self._alive >= self._watchdog_s / 2
        if alive:
            lines.append("WATCHDOG=1")
        if now - self._told >= _STATUS_S:
            left = "" if news.remaining_s is None else f", {duration(news.remaining_s)} left"
            status = one_line(f"{news.state}: {news.done} of {news.total} points{left} {news.message}")
            self._told = now
            if status != self._status:
                self._status = status
                lines.append(f"STATUS={status}")
        if news.state == State.PARKING and not self._stopping and not self.lasts:
            self._stopping = True
            lines.append("STOPPING=1")
        if (lines or self._unsent) and self._send(lines) and alive:
            self._alive = now

    def happened(self, happening: Happening, _facts: RunFacts) -> None:
        """Report ready after every instrument has answered, and stopping at the end of the session."""
        if isinstance(happening.event, AsFound) and not self._ready:
            self._ready = True
            self._alive = self._clock.now()
            self._send(["READY=1", "WATCHDOG=1"])

    def ended(self, text: str) -> None:
        """Report the end of the session; a session that never became ready reports ready in the same message."""
        lines = [] if self._ready else ["READY=1"]
        self._ready = self._stopping = True
        self._send([*lines, f"STATUS={one_line(text)}", "STOPPING=1"], patience_s=1.0)

    def failed(self, text: str) -> None:
        """Report that the session could not begin or continue."""
        self._send([f"STATUS={one_line(text)}"], patience_s=1.0)

    def close(self) -> None:
        """Does nothing: every message has its own socket."""

    def _send(self, lines: list[str], patience_s: float = 0.0) -> bool:
        """Send a message within this many real seconds; returns whether it was sent. An unsent message is sent with
        the next one.
        """
        if self._address is None:
            return False
        lines = [*self._unsent, *lines]
        try:
            with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC) as wire:
                wire.settimeout(patience_s)  # zero: never wait, a busy manager must not delay a run
                wire.sendto("\n".join(lines).encode(), self._address)
        except OSError:
            self._unsent = [line for line in lines if line in ("READY=1", "STOPPING=1")]
            return False
        self._unsent = []
        return True


def _address(text: str) -> str | None:
    """A path, or a name in the abstract namespace, written with an @ for its leading zero byte."""
    if text.startswith("@"):
        return "\0" + text[1:]
    return text if Path(text).is_absolute() else None


def _watchdog_s(env: Mapping[str, str]) -> float:
    """The watchdog's time, seconds; 0 if there is none, or if it belongs to another process."""
    pid = env.get("WATCHDOG_PID", "")
    if pid and pid != str(os.getpid()):
        return 0.0
    try:
        return max(0.0, int(env.get("WATCHDOG_USEC", "0")) / 1e6)
    except ValueError:
        return 0.0
