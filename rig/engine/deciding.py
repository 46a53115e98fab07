"""Reaction to an error: ask the policy, record the decision, read the bench before commanding it.

A write is never repeated blindly: motion is stopped and every state is read back first. A failure of that readback is
decided about in the same way.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from dataclasses import replace

from rig.drivers.clock import Clock
from rig.drivers.errors import DriverError, NoReply, Unreachable
from rig.engine.actions import BenchActions
from rig.engine.failure_counts import Decision, Policies
from rig.engine.fault_classes import FAULTS, TemperatureLeft
from rig.engine.journal import Journal
from rig.engine.states import AT_POINT, State
from rig.procedures.plan.fault_policies import ABORT, HOLD, SKIP
from rig.run_file.events.bench import Fault, ReadBack, Recovered

LEAVE = "leave"
"""Actions that replace giving up while parking: the safe state follows in any case."""

_STOP_AGAIN_S = (1.0, 2.0, 5.0)
"""Pauses between attempts to stop, seconds: short at first, since something may be moving; chosen."""


class Deciding:
    """Decides about errors, in any state.

    Args:
        policies: the fault policies of the procedure.
        journal: where decisions are recorded.
        do: actions on the bench.
        clock: bench time.
        look_up: looks for signals and requests; may raise to interrupt a pause.
        recognise: refuses an exchanged instrument; called for instruments that did not answer for a while.

    """

    def __init__(
        self,
        policies: Policies,
        journal: Journal,
        do: BenchActions,
        clock: Clock,
        *,
        look_up: Callable[[], None],
        recognise: Callable[[], None],
    ) -> None:
        self._policies, self._journal, self._do = policies, journal, do
        self._clock, self._look_up, self._recognise = clock, look_up, recognise

    def decide(self, error: Exception, state: State) -> tuple[Decision, Exception]:
        """Decide, record the decision, and prepare the bench for it.

        Returns:
            The decision, and the error it is about: another one if reading the bench back failed too.

        Raises:
            Exception: the error itself, if no policy covers it.

        """
        while True:
            at = self._journal.at if state in AT_POINT else None
            decision = self._policies.decide(error, at.place if at else str(state), at_point=at is not None)
            if decision is None:
                raise error
            if state is State.PARKING and decision.action in (ABORT, HOLD):
                decision = replace(decision, action=LEAVE)
            self._write(decision, error, state)
            if decision.action in (ABORT, LEAVE) or isinstance(error, TemperatureLeft):
                return decision, error  # the safe state stops everything, and a lost whole plot moves nothing
            if decision.action in (HOLD, SKIP):
                with contextlib.suppress(DriverError):  # the next point, or the hold, will show the fault again
                    self._do.stop_motion()
                return decision, error
            if at is not None:
                at.attempt += 1
            try:
                self._pause(decision.pause_s)
                self._read_back(error)
            except FAULTS as another:
                error = another
                continue
            return decision, error

    def _write(self, decision: Decision, error: Exception, state: State) -> None:
        self._journal.write(
            Fault(
                decision=decision.action,
                message=str(error),
                evidence=getattr(error, "evidence", {}),
                error=type(error).__name__,
                fault=decision.fault,
                where=str(state),
                failure=decision.failure,
                number=decision.number,
                pause_s=decision.pause_s,
            )
        )
        where = f"point {self._journal.at.point.index}" if self._journal.at else str(state)
        self._journal.message = f"{where}, {decision.action}: {error}"

    def _pause(self, seconds: float) -> None:
        """Wait. Chambers that answer, and their interlocks, are watched during the wait."""
        end = self._clock.now() + seconds
        while (left := end - self._clock.now()) > 1e-9:
            self._clock.sleep(min(left, 5.0))
            self._look_up()
            with contextlib.suppress(DriverError):  # the failed instrument may be a chamber
                self._do.chambers.look_around(self._clock.now())

    def _read_back(self, error: Exception) -> None:
        """Stop motion and read every state, before any other command."""
        self._do.stop_motion()
        if isinstance(error, DriverError):
            found = self._do.readback()
            self._journal.write(ReadBack(**found, restarted=self._do.restarted()))
        if isinstance(error, (NoReply, Unreachable)):  # while it was silent it may have been exchanged
            self._recognise()

    def stop_motion(self) -> None:
        """Stop motion, again if that fails. Raises the last error."""
        for pause in _STOP_AGAIN_S:
            with contextlib.suppress(DriverError):
                self._do.stop_motion()
                return
            self._clock.sleep(pause)
        self._do.stop_motion()

    def done(self, place: str) -> None:
        """Record, after success at a place, how its earlier failures ended."""
        failures = self._policies.done(place)
        if failures:
            self._journal.write(Recovered(place=place, failures=failures))
