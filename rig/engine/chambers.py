"""Chambers of a bench: read, checked against interlocks, set; how long nobody looked, and readings that repeat."""

from __future__ import annotations

from typing import Any

from rig.drivers.clock import Clock
from rig.engine.guard import Guard
from rig.instruments.opening import Bench

_INTERLOCK_S = 60.0
"""Age at which chambers are read again for interlocks while points are measured."""
_READ_THE_SAME = 3
"""Equal readings in succession from which a chamber counts as one that repeats: two may be equal by chance."""
_STOOD_S = 60.0
"""Age, seconds, up to which an earlier repetition is told: as long as equal readings take to count as a hang."""
_LONG_AGO = -1e18
"""A clock reading before every other one."""


class Chambers:
    """All chambers of one bench.

    Args:
        bench: opened instruments.
        guard: limits and interlocks.
        clock: bench time.

    Attributes:
        names: of the chambers.
        seen: states as last read, for the run file.

    """

    def __init__(self, bench: Bench, guard: Guard, clock: Clock) -> None:
        self._chambers, self._guard, self._clock = bench.chambers, guard, clock
        self._asked = _LONG_AGO
        self._looked_at: float | None = None
        self._unwatched_s = 0.0
        self._standing: dict[str, tuple[float, float, float, int]] = {}
        self._stood: dict[str, tuple[float, float, float]] = {}
        self.names = tuple(bench.chambers)
        self.seen: dict[str, dict[str, Any]] = {}

    def set(self, name: str, setpoint_degC: float) -> None:
        """Command a chamber's setpoint, limits checked first."""
        self._guard.check_command(f"{name}_degC", setpoint_degC)
        self._chambers[name].set_temperature(setpoint_degC)

    def read(self) -> dict[str, dict[str, Any]]:
        """Read all chambers and check their interlocks; returns the values for the run file."""
        self._asked = self._clock.now()  # before the reads: a chamber that fails is not asked at every poll
        found = {}
        for name, chamber in self._chambers.items():
            state = chamber.read()
            self._guard.check_chamber(name, state)
            found[name] = {
                "setpoint_degC": state.setpoint_degC,
                "temperature_degC": state.temperature_degC,
                "power_pct": state.power_pct,
                "running": state.running,
                **self._unchanged(name, state.temperature_degC),
            }
        self.seen = found
        self._looked()
        return found

    def _unchanged(self, name: str, degC: float) -> dict[str, float]:
        """How long a chamber has repeated its reading to the last digit.

        Returns:
            `unchanged_s`, from the third equal reading on. After two or more equal readings that ended less than a
            minute ago: `stood_ago_s`, when they began, and `stood_s`, how long they lasted. All in bench seconds.

        """
        now = self._clock.now()
        last, since, seen, reads = self._standing.get(name, (degC, now, now, 0))
        if last != degC:
            if reads > 1:
                self._stood[name] = since, seen, now
            since, reads = now, 0
        self._standing[name] = degC, since, now, reads + 1
        if reads + 1 >= _READ_THE_SAME:
            return {"unchanged_s": round(now - since, 3)}
        began, seen, ended = self._stood.get(name, (0.0, 0.0, _LONG_AGO))
        if now - ended > _STOOD_S:
            return {}
        return {"stood_ago_s": round(now - began, 3), "stood_s": round(seen - began, 3)}

    def look_around(self, now: float) -> None:
        """Between polls: read the chambers again if their interlocks have not been checked lately.

        Args:
            now: clock time.

        """
        if self._chambers and now - self._asked > _INTERLOCK_S:
            self.read()

    def as_found(self) -> dict[str, dict[str, Any]]:
        """All chambers as they are, nothing judged."""
        states = {name: chamber.read() for name, chamber in self._chambers.items()}
        self._asked = _LONG_AGO  # interlocks are not judged here, and an earlier reading may have failed
        self._looked()
        return {
            name: {
                "setpoint_degC": s.setpoint_degC,
                "temperature_degC": s.temperature_degC,
                "running": s.running,
                **self._unchanged(name, s.temperature_degC),
            }
            for name, s in states.items()
        }

    def take_unwatched_s(self) -> float:
        """The longest time without a look at any chamber, bench seconds, since the last call."""
        self._looked()
        longest, self._unwatched_s = self._unwatched_s, 0.0
        return longest

    def _looked(self) -> None:
        """Note a look at the chambers, or that the time since the last one begins anew."""
        now = self._clock.now()
        if self._looked_at is not None:
            self._unwatched_s = max(self._unwatched_s, now - self._looked_at)
        self._looked_at = now
