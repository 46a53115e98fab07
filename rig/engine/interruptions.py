"""What may interrupt a wait: a signal, or a request beside the run file."""

from __future__ import annotations

from collections.abc import Callable

from rig.engine import holes
from rig.engine.by_hand.asking import ByHand
from rig.engine.holes import HoleInTime, WatchedClock
from rig.engine.journal import Journal
from rig.engine.session import Signals
from rig.engine.states import State
from rig.run_file.events.sessions import Hole
from rig.run_file.live import Requests

_NEWS_S = 1.0
"""Bench seconds after which polls of one state are news for observers; every change of state is."""


class Interrupted(Exception):
    """A signal asks to end this session; the run can be resumed later."""


class HoldRequested(Exception):
    """A person asks to hold the run."""


class StopRequested(Exception):
    """A person asks to stop the run."""


class Interruptions:
    """Signals and requests; the sequencer looks for them wherever it waits.

    Args:
        signals: set from a signal handler.
        requests: requests of people.
        journal: told that a request has been seen.
        state: where the sequencer is.
        clock: bench time; notices holes.
        by_hand: steps by hand; told that one is done.

    Attributes:
        released: whether the last request was to release a hold.
        who: who made the last request; None if unknown.
        hole: whether time had a hole since this was last reset.

    """

    def __init__(
        self,
        signals: Signals,
        requests: Requests,
        journal: Journal,
        state: Callable[[], State],
        clock: WatchedClock,
        by_hand: ByHand,
    ) -> None:
        self._signals, self._requests, self._journal, self._state = signals, requests, journal, state
        self._clock, self._by_hand = clock, by_hand
        self.released = self.hole = False
        self.who: str | None = None

    def look_up(self, now: float | None = None) -> None:
        """Report the state, and look for signals, requests and holes that the clock has noted.

        Args:
            now: clock time of a poll, at which the state is only reported after a while; None to report it now.

        Raises:
            Interrupted, HoldRequested, StopRequested: as requested.
            HoleInTime: see `check_time`.

        """
        if self._clock.noted:
            self.check_time()
        if self._signals.interrupt:
            raise Interrupted
        request = self._requests.poll()
        if request is not None and self._state() != State.PARKING:  # parking ends the session: too late for any
            refused = self._by_hand.take(request) if request.verb in ("release", "done") else ""
            self._journal.acknowledge(request.request_id, refused)
            self.who = request.who or None
            if request.verb == "stop":
                raise StopRequested
            if request.verb == "hold" and self._state() != State.HOLDING:
                raise HoldRequested
            self.released = request.verb == "release" and not refused
        if now is None or now - self._journal.told_s >= _NEWS_S:
            self._journal.tell()

    def check_time(self) -> None:
        """Record a hole in time. Raises `HoleInTime` if the present work must not go on after it."""
        hole = self._clock.take_hole()
        if hole is not None:
            self._record(hole)

    def _record(self, hole: holes.Hole) -> None:
        found, state = HoleInTime(hole), self._state()
        self.hole = True
        self._journal.write(Hole(hole_s=found.hole_s, where=str(state)))
        if state not in (State.HOLDING, State.PARKING):  # a hold checks the bench when it ends; parking ends the run
            raise found
