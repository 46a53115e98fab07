"""Virtual time: one thread, one queue of events, no waiting.

A `World` owns the time of a simulated bench. Twins schedule their actions (`call_in`). A caller that waits pumps the
queue (`sleep`, `run_until`), and time jumps from event to event. It has the methods of a clock (`now`, `utc`, `sleep`,
`timeout`, `stopwatch`), so that code independent of the simulation can use it.
"""

from __future__ import annotations

from collections.abc import Callable
from heapq import heappop, heappush
from math import inf
from time import monotonic, perf_counter, sleep, time

EPOCH_UTC = 1_768_500_000.0
"""UTC at virtual time zero unless the world file says otherwise: 2026-01-15 18:00:00."""


class Deadlock(RuntimeError):
    """A caller waits without a timeout, and no scheduled event could end the wait."""


class Timer:
    """A scheduled call that can be cancelled."""

    __slots__ = ("action",)

    def __init__(self, action: Callable[[], None]) -> None:
        self.action: Callable[[], None] | None = action

    def cancel(self) -> None:
        """Cancel the call; harmless if it has already happened."""
        self.action = None


class World:
    """Virtual time.

    Args:
        start: first value of `now()`, seconds; a resumed dry run starts where the last one stopped, plus a gap.
        epoch_utc: UTC at `now() == 0`, seconds since 1970-01-01.

    Attributes:
        local_offset_s: local time minus UTC, changed by daylight saving time. Nothing here reads it.
    """

    def __init__(self, start: float = 0.0, epoch_utc: float = EPOCH_UTC) -> None:
        self._now = float(start)
        self._epoch_utc = epoch_utc
        self.local_offset_s = 0.0
        self._queue: list[tuple[float, int, Timer | Callable[[], None]]] = []
        self._count = 0
        self._away_until = -inf

    def now(self) -> float:
        """Virtual seconds."""
        return self._now

    def utc(self) -> float:
        """Virtual UTC, seconds since 1970-01-01."""
        return self._epoch_utc + self._now

    def step_utc(self, seconds: float) -> None:
        """Set UTC forward or back; `now()` is not affected."""
        self._epoch_utc += seconds

    def idle(self, seconds: float) -> None:
        """Let virtual time pass at real pace, at most 50 ms real time: the awaited person is outside the simulation."""
        sleep(min(seconds, 0.05))
        self.sleep(seconds)

    def grace(self) -> float:
        """Nothing is late in virtual time."""
        return 0.0

    def timeout(self, seconds: float) -> float:
        """There are no operating-system waits in virtual time; the value is returned unchanged."""
        return seconds

    stopwatch = staticmethod(perf_counter)
    """Real seconds of this machine, to report the speed of the simulation."""

    def call_in(self, seconds: float, action: Timer | Callable[[], None]) -> None:
        """Call `action` after `seconds` (never before now)."""
        self._count += 1
        heappush(self._queue, (self._now + seconds if seconds > 0.0 else self._now, self._count, action))

    def timer_in(self, seconds: float, action: Callable[[], None]) -> Timer:
        """Call `action` after `seconds`; returns a timer that cancels the call."""
        timer = Timer(action)
        self.call_in(seconds, timer)
        return timer

    def sleep(self, seconds: float) -> None:
        """Let virtual time pass, with all events that fall due."""
        if seconds <= 0:
            return
        end, queue = self._now + seconds, self._queue
        if (queue and queue[0][0] <= end) or self._now < self._away_until:
            self.run_until(end)
        else:
            self._now = end  # nothing happens meanwhile

    def next_due(self) -> float | None:
        """Time of the next event, None if there is none."""
        queue = self._queue
        while queue and isinstance(timer := queue[0][2], Timer) and timer.action is None:
            heappop(queue)
        return queue[0][0] if queue else None

    def suspend(self, seconds: float) -> None:
        """Stall the caller for this long, like a stopped process: the world continues without it."""
        self._away_until = max(self._away_until, self._now + seconds)

    def run_until(self, end: float | None, predicate: Callable[[], object] | None = None) -> bool:
        """Run events in order until `predicate` is true or time reaches `end`.

        Args:
            end: virtual time to stop at; None waits only for the predicate.
            predicate: checked before the first event and after each one.

        Returns:
            Whether the predicate held (always False without one; time is then exactly `end`).

        Raises:
            Deadlock: `end` is None and the queue is empty.
        """
        awaited = _nothing if predicate is None else predicate
        held = awaited()
        queue, last = self._queue, inf if end is None else end
        while not held and queue and queue[0][0] <= last:
            at, _, action = heappop(queue)
            if isinstance(action, Timer):
                timer, called = action, action.action
                if called is None:
                    continue
                timer.action, action = None, called
            if at > self._now:
                self._now = at
            action()
            held = awaited()
        if not held:
            if end is None:
                raise Deadlock("waiting for ever: nothing is scheduled in this world and no timeout was given")
            if end > self._now:
                self._now = end
        if self._now < self._away_until:
            self.run_until(self._away_until)
        return bool(held)


def _nothing() -> bool:
    """Never holds."""
    return False


class Pace:
    """Ties a world to real time, for clients in other processes.

    Args:
        world: the world; its present time is now.
        speed: virtual seconds per real second.

    Attributes:
        epoch_utc: the world's UTC at this moment.
        started_utc: the machine's UTC at this moment.
    """

    def __init__(self, world: World, speed: float) -> None:
        self._world = world
        self._speed = speed
        self._virtual = world.now()
        self._real = monotonic()
        self.epoch_utc = world.utc()
        self.started_utc = time()

    def catch_up(self) -> None:
        """Let the world reach the present."""
        self._world.run_until(self._virtual + (monotonic() - self._real) * self._speed)

    def real_s(self) -> float:
        """Real seconds since the beginning."""
        return monotonic() - self._real

    def until_next(self, most: float) -> float:
        """Real seconds until the world's next event, at most `most`."""
        due = self._world.next_due()
        if due is None:
            return most
        return min(most, max(0.0, (due - self._virtual) / self._speed - self.real_s()))
