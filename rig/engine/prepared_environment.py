"""Whether the prepared environment still holds after a gap or a hold; this decides how the run continues."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rig.engine.journal import Journal
from rig.engine.queue import PointQueue
from rig.engine.settling import SETPOINT_STANDS
from rig.engine.soaking import Soaking
from rig.procedures.plan.conduct import Conduct, EnvironmentSettings


class PreparedEnvironment:
    """Judges the prepared environment.

    Args:
        conduct: environment and recovery.
        journal: the work done, and its times.
        queue: points still to be observed.
        soaking: soaks whole plots; None if no factor is hard to change.

    """

    def __init__(self, conduct: Conduct, journal: Journal, queue: PointQueue, soaking: Soaking | None) -> None:
        self._conduct, self._journal, self._queue, self._soaking = conduct, journal, queue, soaking

    def go_on(
        self, as_found: Mapping[str, Any], restarted: Sequence[str], *, certain: bool = True, known: bool = True
    ) -> str:
        """The next trigger: "recover" if the prepared environment still holds, "prepare" if not.

        Args:
            as_found: axes and chambers as found, before any command.
            restarted: instruments that have lost power.
            certain: whether the time since was measured by one clock.
            known: whether this time is known at all.

        Raises:
            TemperatureLeft: the open whole plot was lost.

        """
        fold, at = self._journal.fold, self._journal.at
        # Counted from the last work, so that a session that was killed while preparing does not hide a gap.
        idle_s = self._journal.elapsed() - (fold.worked_s or 0.0)
        point = at.point if at else self._queue.peek()
        if self._soaking is not None and point is not None:
            if fold.whole_plot is None or point.whole_plot != fold.planned:
                return "prepare"
            why = self._soaking.lost_meanwhile(point, idle_s, certain=certain, restarted=restarted, as_found=as_found)
            if why:
                self._soaking.lose(why)
            return "recover"
        homed = all(axis["homed"] for axis in as_found["axes"].values())
        stands = homed and self.environment_stands(as_found["chambers"])
        if fold.prepared and stands and known and idle_s <= self._conduct.max_gap_s:
            return "recover"
        return "prepare"

    def environment_stands(self, chambers: Mapping[str, Any]) -> bool:
        """Whether every chamber is at the setpoint of the procedure."""
        return stands(self._conduct.environment, chambers)


def stands(wanted: EnvironmentSettings | None, chambers: Mapping[str, Any]) -> bool:
    """Whether every chamber controls at the setpoint of the procedure, and reads it within its tolerance."""
    return commanded(wanted, chambers) and (
        wanted is None
        or all(abs(c["temperature_degC"] - wanted.setpoint_degC) <= wanted.tolerance_degC for c in chambers.values())
    )


def commanded(wanted: EnvironmentSettings | None, chambers: Mapping[str, Any]) -> bool:
    """Whether every chamber controls at the setpoint of the procedure, if it has one."""
    return wanted is None or all(
        c["running"] and abs(c["setpoint_degC"] - wanted.setpoint_degC) < SETPOINT_STANDS for c in chambers.values()
    )
