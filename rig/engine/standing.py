"""Whether what was prepared still stands after a gap or a hold, by what is read; and so how the run goes on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from procedures.conduct import Conduct
from rig.engine.journal import Journal
from rig.engine.queue import PointQueue
from rig.engine.settling import SETPOINT_STANDS
from rig.engine.soaking import Soaking


class Standing:
    """Judges what was prepared.

    Args:
        conduct: environment and recovery.
        journal: what was done, and when last.
        queue: points still to be observed.
        soaking: whole plots, None where nothing is hard to change.

    """

    def __init__(self, conduct: Conduct, journal: Journal, queue: PointQueue, soaking: Soaking | None) -> None:
        self._conduct, self._journal, self._queue, self._soaking = conduct, journal, queue, soaking

    def go_on(
        self, as_found: Mapping[str, Any], restarted: Sequence[str], *, certain: bool = True, known: bool = True
    ) -> str:
        """The trigger that follows: "recover" if what was prepared still stands, "prepare" if not.

        Args:
            as_found: axes and chambers as just read, before anything was commanded.
            restarted: instruments whose power has been off.
            certain: whether the time since was measured by one clock.
            known: whether it was measured at all.

        Raises:
            TemperatureLeft: the open whole plot was lost.

        """
        fold, at = self._journal.fold, self._journal.at
        # Counted from the last work done, so that sessions which were killed while preparing do not hide a gap.
        idle_s = self._journal.elapsed() - (fold.worked_s or 0.0)
        point = at.point if at else self._queue.peek()
        if self._soaking is not None and point is not None:
            if fold.whole_plot is None or point.whole_plot != fold.planned:
                return "prepare"
            why = self._soaking.rules.lost_meanwhile(
                point, idle_s, certain=certain, restarted=restarted, as_found=as_found
            )
            if why:
                self._soaking.lose(why)
            return "recover"
        homed = all(axis["homed"] for axis in as_found["axes"].values())
        stands = homed and self.environment_stands(as_found)
        if fold.prepared and stands and known and idle_s <= self._conduct.max_gap_s:
            return "recover"
        return "prepare"

    def environment_stands(self, as_found: Mapping[str, Any]) -> bool:
        """Whether every chamber is where the procedure wants it."""
        wanted = self._conduct.environment
        return wanted is None or all(
            c["running"]
            and abs(c["setpoint_degC"] - wanted.setpoint_degC) < SETPOINT_STANDS
            and abs(c["temperature_degC"] - wanted.setpoint_degC) <= wanted.tolerance_degC
            for c in as_found["chambers"].values()
        )
