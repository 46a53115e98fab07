"""The clock, passed to every part. Nothing else in the project reads a clock or sleeps.

A `Clock` counts *bench seconds*. On a real bench these are real seconds; against `rig sim --speed N` they run N times
faster than real time; in a dry run they are the virtual time of a `sims.World`, which satisfies this protocol by shape
and never waits at all.
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import Protocol

_BOOTTIME = getattr(time, "CLOCK_BOOTTIME", time.CLOCK_MONOTONIC)


class Clock(Protocol):
    """The clock of the whole controller."""

    def now(self) -> float:
        """Bench seconds since an arbitrary origin; never steps, keeps counting while the machine sleeps."""
        ...

    def utc(self) -> float:
        """Coordinated Universal Time in seconds since 1970-01-01; may be stepped by the system."""
        ...

    def sleep(self, seconds: float) -> None:
        """Let `seconds` bench seconds pass; zero or less returns at once."""
        ...

    def idle(self, seconds: float) -> None:
        """Let bench time pass while waiting for a person: real time passes too, even with virtual time."""
        ...

    def timeout(self, seconds: float) -> float:
        """Maximum real seconds of an operating-system wait when the instrument needs `seconds`."""
        ...

    def grace(self) -> float:
        """Bench seconds beyond a deadline for the process of a simulated instrument to be scheduled."""
        ...

    def stopwatch(self) -> float:
        """Real seconds of this machine, to report the duration of our own work; never for decisions."""
        ...


class RealClock:
    """The machine's clock: CLOCK_BOOTTIME for durations (it counts through suspend), UTC for dates."""

    def now(self) -> float:
        """Bench seconds since an arbitrary origin; never steps, keeps counting while the machine sleeps."""
        return time.clock_gettime(_BOOTTIME)

    def utc(self) -> float:
        """Coordinated Universal Time in seconds since 1970-01-01; may be stepped by the system."""
        return time.time()

    def sleep(self, seconds: float) -> None:
        """Let `seconds` bench seconds pass; zero or less returns at once."""
        if seconds > 0:
            time.sleep(seconds)

    def idle(self, seconds: float) -> None:
        """Let bench time pass while waiting for a person: real time passes too, even with virtual time."""
        self.sleep(seconds)

    def timeout(self, seconds: float) -> float:
        """Maximum real seconds of an operating-system wait when the instrument needs `seconds`."""
        return seconds

    def grace(self) -> float:
        """Bench seconds beyond a deadline for the process of a simulated instrument to be scheduled. A real instrument
        needs none.
        """
        return 0.0

    stopwatch = staticmethod(time.perf_counter)
    """Real seconds of this machine, for the duration of our own work only."""


_TURN_S = 0.2
"""Real seconds after which a process that shares this machine's processors has surely been scheduled."""


class ScaledClock(RealClock):
    """Real time run `speed` times faster, for benches served by `rig sim --speed N` in another process.

    Args:
        speed: bench seconds per real second.
        epoch_utc: UTC of bench time at the start of the simulated bench, seconds since 1970-01-01.
        started_utc: the machine's UTC at the same moment.
    """

    def __init__(self, speed: float, epoch_utc: float, started_utc: float) -> None:
        if not speed > 0:
            raise ValueError(f"speed must be positive, not {speed}")
        self._speed = speed
        self._epoch_utc = epoch_utc
        self._started_utc = started_utc

    def now(self) -> float:
        """Bench seconds since an arbitrary origin; never steps, keeps counting while the machine sleeps."""
        return super().now() * self._speed

    def utc(self) -> float:
        """Coordinated Universal Time in seconds since 1970-01-01; may be stepped by the system."""
        return self._epoch_utc + (super().utc() - self._started_utc) * self._speed

    def sleep(self, seconds: float) -> None:
        """Let `seconds` bench seconds pass; zero or less returns at once."""
        super().sleep(seconds / self._speed)

    def timeout(self, seconds: float) -> float:
        """Bench seconds as real seconds, plus the time for two processes that share this machine's processors."""
        return seconds / self._speed + _TURN_S

    def grace(self) -> float:
        """Bench seconds beyond a deadline for the process of a simulated instrument to be scheduled."""
        return _TURN_S * self._speed


def boot_id() -> str:
    """Identifier of this boot of the machine; CLOCK_BOOTTIME values are comparable only within one boot.

    Returns an empty string if the kernel does not give one; callers must treat it as "another boot".
    """
    try:
        return Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii").strip()
    except OSError:
        return ""
