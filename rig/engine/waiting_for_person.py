"""Waiting for a person: until a hold is released, or until a step by hand is done."""

from __future__ import annotations

from collections.abc import Callable

from rig.drivers.clock import Clock
from rig.drivers.errors import DriverError
from rig.engine.actions import BenchActions
from rig.engine.by_hand.asking import ByHand
from rig.engine.deciding import Deciding
from rig.engine.fault_classes import InterlockHold
from rig.engine.interruptions import Interruptions
from rig.engine.journal import Journal
from rig.engine.states import State
from rig.procedures.plan.fault_policies import ABORT, HOLD
from rig.run_file.events.sessions import Released


class NobodyCame(Exception):
    """The wait took too long. `asked` says whether it was for a step by hand."""

    def __init__(self, words: str, *, asked: bool) -> None:
        super().__init__(words)
        self.asked = asked


class CannotHold(Exception):
    """The bench fails while it is held, and its fault policy gives up."""


class Holding:
    """Waits in state "holding".

    Args:
        by_hand: steps by hand.
        journal: where the end of a hold is recorded.
        do: actions on the bench.
        deciding: decides about errors meanwhile.
        interruptions: signals and requests.
        clock: bench time.
        hold_max_s: longest hold, seconds.
        look: looks at the open whole plot, if there is one.

    """

    def __init__(
        self,
        by_hand: ByHand,
        journal: Journal,
        do: BenchActions,
        deciding: Deciding,
        interruptions: Interruptions,
        clock: Clock,
        hold_max_s: float,
        look: Callable[[], None],
    ) -> None:
        self._by_hand, self._journal, self._do, self._deciding = by_hand, journal, do, deciding
        self._interruptions, self._clock, self._hold_max_s = interruptions, clock, hold_max_s
        self._look = look

    def until_done(self) -> str:
        """Wait until the step by hand is done. A person had their hands on the bench: it is checked as after a crash.

        A reading leaves the bench as it is: the point goes on, unless the bench failed meanwhile or time had a hole.

        Returns:
            the trigger "repeat-check", or "measure" after a reading.

        Raises:
            NobodyCame, CannotHold: see there.
            Interrupted, StopRequested: as requested.

        """
        why, self._interruptions.hole = "", False
        self._journal.message = self._by_hand.message
        self._journal.tell(now=True)
        try:
            while True:
                self._journal.message = f"{self._by_hand.message}{f' ({why})' if why else ''}"
                if self._by_hand.done():
                    self._journal.message = ""
                    as_before = self._by_hand.reads and not why and not self._interruptions.hole
                    return "measure" if as_before else "repeat-check"
                try:
                    self._do.chambers.look_around(self._clock.now())
                    self._look()
                except InterlockHold as error:
                    why = str(error)
                except DriverError as error:
                    why = self._failed(error) or why
                    continue
                self._by_hand.wait()
                self._interruptions.look_up()
                if late := self._by_hand.overdue:
                    raise NobodyCame(late, asked=True)
        finally:
            self._by_hand.forget()

    def until_released(self, go_on: Callable[[], str]) -> str:
        """Wait for the release of a hold.

        Args:
            go_on: reads the bench and returns the next trigger.

        Raises:
            NobodyCame, CannotHold: see there.
            Interrupted, StopRequested: as requested.

        """
        why = self._journal.message
        self._interruptions.released = told = False
        limit = self._clock.now() + self._hold_max_s
        while True:
            self._journal.message = f"held{f' ({why})' if why else ''}; release it with `rig release`"
            try:
                if self._interruptions.released:
                    self._journal.message = ""
                    if not told:  # once, also if the look at the bench that follows has to be repeated
                        self._journal.write(Released(who=self._interruptions.who))
                    told = True
                    return go_on()
                self._do.chambers.look_around(self._clock.now())
                self._look()
            except InterlockHold as error:
                why = str(error)
            except DriverError as error:
                held = self._failed(error)
                if held:  # the run holds again, and this release has been used up
                    self._interruptions.released = told = False
                    why = held
                continue
            self._clock.idle(1.0)
            self._interruptions.look_up()
            if self._clock.now() > limit:
                raise NobodyCame(f"held for {self._hold_max_s / 3600:g} h and nobody released it; parked", asked=False)

    def _failed(self, error: DriverError) -> str:
        """Decide about an error. Returns why the run holds now, "" if it only tries again."""
        decision, what = self._deciding.decide(error, State.HOLDING)
        if decision.action == ABORT:
            raise CannotHold(str(what))
        return str(what) if decision.action == HOLD else ""
