"""The end of a run: axes go to their parking positions, then every instrument to its safe state; durations are
recorded.
"""

from __future__ import annotations

import contextlib
from dataclasses import replace
from typing import Protocol

from rig.drivers.clock import Clock
from rig.drivers.errors import DriverError
from rig.engine.actions import BenchActions
from rig.engine.deciding import LEAVE, Deciding
from rig.engine.fault_classes import FAULTS, InterlockHold
from rig.engine.journal import Journal
from rig.engine.safe_state import make_safe, outputs_on
from rig.engine.states import State
from rig.errors import StorageError
from rig.instruments.opening import Bench
from rig.run_file.events.bench import MadeSafe


class SetUp(Protocol):
    """Sets the instruments as the bench declares, when that is due."""

    def __call__(self, *, again: bool = False) -> None:
        """Set up if it is due, or in any case with `again`."""
        ...


class Parking:
    """Parks a bench and makes it safe.

    Args:
        bench: opened instruments.
        do: actions on them.
        journal: where it is recorded.
        deciding: decides about errors while parking.
        clock: bench time.
        set_up: see `SetUp`.

    """

    def __init__(
        self, bench: Bench, do: BenchActions, journal: Journal, deciding: Deciding, clock: Clock, set_up: SetUp
    ) -> None:
        self._bench, self._do, self._journal = bench, do, journal
        self._deciding, self._clock, self._set_up = deciding, clock, set_up

    def park(self, poll_s: float, timeout_s: float) -> str:
        """Drive the axes to their parking positions. Returns the reason for a failure, "" if none; the safe state
        follows anyway.
        """
        again = False
        while True:
            try:
                self._set_up(again=again)
                self._do.park(poll_s, timeout_s)
            except InterlockHold as error:
                return f"not parked: {error}"
            except FAULTS as error:
                decision, what = self._deciding.decide(error, State.PARKING)
                again = isinstance(what, DriverError)
                if decision.action == LEAVE:
                    return f"not parked: {what}"
                continue
            return ""

    def leave(self) -> tuple[list[str], MadeSafe | None]:
        """Leave the bench at an interruption: what the bench file declares is switched off, the rest stays on.

        Returns:
            outputs that stay on, with their values; what was brought to its safe state, None if nothing was to be.

        """
        names, safety = list(self._bench.instruments), self._bench.config.safety
        off = [name for name in names if safety.switched_off(name)]
        safe = make_safe(self._bench, self._clock, off) if off else None
        if safe is not None:
            with contextlib.suppress(StorageError):
                self._journal.write(safe)
            # What was switched off is left out; what could not be is still asked for its output.
            failed = {words.partition(":")[0] for words in safe.unsafe}
            names = [name for name in names if name not in off or name in failed]
        return outputs_on(self._bench, names), safe

    def make_safe(self, *, complete: bool = False) -> MadeSafe:
        """Bring the bench to its safe state; the duration and readbacks are recorded if possible.

        Args:
            complete: whether the run is complete: then the chambers that the next run of its loop takes over stay on,
                unless something else could not be made safe.
        """
        stays = self._bench.stays_on if complete else frozenset()
        safe = make_safe(self._bench, self._clock, self._bench.instruments.keys() - stays if stays else None)
        if stays and safe.unsafe:
            safe = make_safe(self._bench, self._clock)
        elif stays:
            safe = replace(safe, stays_on=tuple(outputs_on(self._bench, sorted(stays))))
        with contextlib.suppress(StorageError):
            self._journal.write(safe)
        return safe
