"""Gaps in the controller's time ("holes"): the process did not run, although it was not waiting for anything.

A process that was stopped (SIGSTOP), swapped out, or suspended with its machine does not notice this directly: only
the next reading of the clock is too late. A chamber may have drifted or a person may have changed something in this
time. The known state of the bench is then as old as after a crash. The clock that engine and drivers share
detects the hole. The sequencer then checks the bench as it does when a run is resumed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from rig.drivers.clock import Clock

HOLE_S = 10.0
"""Permitted time between two readings of the clock, besides announced waits, seconds: a slow disk, a busy machine."""
_GRACES = 5.0
"""Where bench time runs faster than real time, a busy machine's pauses are longer in bench seconds."""


@dataclass(frozen=True)
class Hole:
    """An interval of bench time in which the controller did not run.

    Attributes:
        began: clock reading at the last sign of life before it.
        seconds: its length, less any announced wait.

    """

    began: float
    seconds: float


class HoleInTime(Exception):
    """The controller did not run for longer than its waits explain; its knowledge of the bench is out of date."""

    def __init__(self, hole: Hole) -> None:
        super().__init__(f"the controller had no turn for {hole.seconds:.0f} s (stopped, or the machine asleep?)")
        self.hole = hole

    @property
    def hole_s(self) -> float:
        """Its fields for the run file."""
        return round(self.hole.seconds, 3)


class WatchedClock:
    """A clock that detects holes: every use of it is a sign of life. It satisfies `rig.drivers.clock.Clock`.

    Args:
        clock: the clock it reads.

    Attributes:
        noted: whether `take_hole` has a hole to give, as of the last use of this clock.

    """

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._read, self._last = clock.now, clock.now()
        self._explained = 0.0
        self._hole: Hole | None = None
        self.noted = False

    def take_hole(self) -> Hole | None:
        """The longest hole since the last call, None if there was none."""
        self.now()
        if self._hole is None:
            return None
        hole, self._hole, self.noted = self._hole, None, False
        return hole

    def now(self) -> float:
        """Bench seconds since an arbitrary origin; never steps, keeps counting while the machine sleeps."""
        now = self._read()
        if now - self._last > HOLE_S + self._explained:
            self._note(now)
        self._last = now
        return now

    def _note(self, now: float) -> None:
        seconds = now - self._last - self._explained
        if seconds > HOLE_S + _GRACES * self._clock.grace() and (self._hole is None or seconds > self._hole.seconds):
            self._hole, self.noted = Hole(self._last, seconds), True

    def utc(self) -> float:
        """Coordinated Universal Time in seconds since 1970-01-01; may be stepped by the system."""
        return self._clock.utc()

    def sleep(self, seconds: float) -> None:
        """Let `seconds` bench seconds pass; zero or less returns at once."""
        self.pause(seconds)

    def pause(self, seconds: float) -> float:
        """Sleep, and return the clock's reading after it."""
        read, before = self._read, self._explained  # `now` twice, without its calls: every poll pauses
        now = read()
        if now - self._last > HOLE_S + before:
            self._note(now)
        self._last = now
        self._explained = seconds if seconds > 0.0 else 0.0
        self._clock.sleep(seconds)
        now = read()
        if now - self._last > HOLE_S + self._explained:
            self._note(now)
        self._last, self._explained = now, before
        return now

    def idle(self, seconds: float) -> None:
        """Let bench time pass while waiting for a person: real time passes too, even with virtual time."""
        self.now()
        before, self._explained = self._explained, max(seconds, 0.0)
        self._clock.idle(seconds)
        self.now()
        self._explained = before

    def timeout(self, seconds: float) -> float:
        """Maximum real seconds of an operating-system wait when the instrument needs `seconds`. The caller is about to
        wait for at most this long, until the next wait is announced.
        """
        self.now()
        self._explained = seconds if seconds > 0.0 else 0.0
        return self._clock.timeout(seconds)

    def grace(self) -> float:
        """Bench seconds beyond a deadline for the process of a simulated instrument to be scheduled."""
        return self._clock.grace()

    @property
    def stopwatch(self) -> Callable[[], float]:
        """Real seconds of this machine, to report the duration of our own work; never for decisions. That of the clock
        it reads, which is no sign of life.
        """
        return self._clock.stopwatch


def watched(clock: Clock) -> WatchedClock:
    """A watched clock; the clock itself if it is one already."""
    return clock if isinstance(clock, WatchedClock) else WatchedClock(clock)
