"""What the sequencer does with a bench: home, go, settle, measure, prepare the environment, park.

Each action commands, then polls; every wait goes through `wait`, which lets the sequencer look for signals and
requests. All may raise `drivers.errors.DriverError`; what this module adds is named below.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from drivers.clock import Clock
from drivers.errors import InstrumentError
from drivers.roles import AxisState
from procedures.pitch_roll import EnvironmentSettings, SettleSettings
from rig.bench import Bench
from rig.engine.guard import Guard
from rig.engine.measuring import Observation, assemble
from rig.engine.motion import Arrival, Leg, arrived
from rig.engine.settling import Criteria, Settling
from rig.errors import BenchFault

_HOMING_TIMEOUT_S = 900.0
_MOVE_TIMEOUT_S = 600.0
_INTERLOCK_S = 60.0


class NotSettled(Exception):
    """A quantity did not arrive in time. `evidence` is what was seen."""

    def __init__(self, message: str, evidence: Mapping[str, Any]) -> None:
        super().__init__(message)
        self.evidence = evidence


class BenchActions:
    """Actions on one bench.

    Args:
        bench: opened instruments.
        guard: limits and interlocks.
        clock: bench time.
        wait: lets that many bench seconds pass; may raise to interrupt the action.

    """

    def __init__(self, bench: Bench, guard: Guard, clock: Clock, wait: Callable[[float], None]) -> None:
        self._bench = bench
        self._guard = guard
        self._clock = clock
        self._wait = wait
        self._head = bench.head
        self._chambers = bench.chambers
        self._readers = bench.readers
        self._chambers_seen = -1e18
        self.arrivals: dict[str, Arrival] = {}

    def stop_motion(self) -> None:
        """Stop all axes; how they came to rest is unknown from now on."""
        self._head.stop()
        self.arrivals.clear()

    def set_up(self) -> None:
        """Bring every instrument's settings to what the bench declares."""
        for instrument in self._bench.instruments.values():
            instrument.prepare()

    def axes(self) -> Mapping[str, AxisState]:
        """Read all axes; raises on a drive fault or a violated limit."""
        states = self._head.read()
        self._guard.check_axes(states)
        for axis, state in states.items():
            if state.fault:
                raise InstrumentError(f"{axis} drive", 0, state.fault)
        return states

    def environment(self) -> dict[str, dict[str, Any]]:
        """Read all chambers, check their interlocks; what the run file keeps."""
        self._chambers_seen = self._clock.now()
        found = {}
        for name, chamber in self._chambers.items():
            state = chamber.read()
            self._guard.check_chamber(name, state)
            found[name] = {
                "setpoint_degC": state.setpoint_degC,
                "temperature_degC": state.temperature_degC,
                "power_pct": state.power_pct,
                "running": state.running,
            }
        return found

    def look_around(self) -> None:
        """Check the chambers' interlocks if that was last done a while ago."""
        if self._clock.now() - self._chambers_seen >= _INTERLOCK_S:
            self.environment()

    def readback(self) -> dict[str, Any]:
        """Positions, homed flags and chamber states as found, nothing commanded and nothing judged."""
        axes = {
            axis: {"position_deg": s.position_deg, "homed": s.homed, "enabled": s.enabled, "fault": s.fault}
            for axis, s in self._head.read().items()
        }
        chambers = {name: c.read() for name, c in self._chambers.items()}
        return {
            "axes": axes,
            "chambers": {
                name: {"setpoint_degC": s.setpoint_degC, "temperature_degC": s.temperature_degC, "running": s.running}
                for name, s in chambers.items()
            },
        }

    def home(self, poll_s: float) -> bool:
        """Find the encoders' zeros where they are not known; returns whether anything was homed."""
        if all(state.homed for state in self.axes().values()):
            return False
        self._head.home()
        self.arrivals.clear()
        self._until_still(poll_s, _HOMING_TIMEOUT_S, "homing")
        lost = [axis for axis, state in self.axes().items() if not state.homed]
        if lost:
            raise BenchFault(f"{' and '.join(lost)} did not find home; look at the head's limit and home switches")
        return True

    def go(self, legs: Sequence[Leg], poll_s: float) -> None:
        """Drive through legs, all axes of a leg together, noting from which side each axis arrives."""
        for leg in legs:
            for axis, target in leg.items():
                self._guard.check_command(f"{axis}_deg", target)
            start = {axis: state.position_deg for axis, state in self.axes().items()}
            for axis in leg:
                self.arrivals.pop(axis, None)
            self._head.move(leg)
            self._until_still(poll_s, _MOVE_TIMEOUT_S, "moving")
            arrived(leg, start, self.arrivals)

    def _until_still(self, poll_s: float, timeout_s: float, what: str) -> None:
        began = self._clock.now()
        while True:
            self._wait(poll_s)
            states = self.axes()
            if not any(state.moving for state in states.values()):
                return
            if self._clock.now() - began > timeout_s:
                late = ", ".join(f"{axis} at {s.position_deg:g} deg" for axis, s in states.items() if s.moving)
                self.stop_motion()
                raise NotSettled(f"{what} took longer than {timeout_s:g} s ({late})", {})

    def settle(self, targets: Mapping[str, float], settings: SettleSettings) -> dict[str, Any]:
        """Wait until every axis has settled at its target; returns the evidence. Raises `NotSettled`."""
        criteria = {
            axis: Criteria(target, settings.band_deg, settings.dwell_s, settings.drift_deg_per_s, settings.timeout_s)
            for axis, target in targets.items()
        }

        def read() -> dict[str, float]:
            return {axis: state.position_deg for axis, state in self.axes().items()}

        return self._until_settled(criteria, read, settings.poll_s)

    def _until_settled(
        self, criteria: Mapping[str, Criteria], read: Callable[[], Mapping[str, float]], poll_s: float
    ) -> dict[str, Any]:
        began = self._clock.now()
        judges = {name: Settling(c, began) for name, c in criteria.items()}
        while True:
            values = read()
            now = self._clock.now()
            outcomes = {name: judge.add(now, values[name]) for name, judge in judges.items()}
            if "waiting" not in outcomes.values():
                break
            self._wait(poll_s)
        evidence = {name: judge.evidence() for name, judge in judges.items()}
        failed = [f"{name} {outcome}" for name, outcome in outcomes.items() if outcome != "settled"]
        if failed:
            raise NotSettled(f"{', '.join(failed)} after {now - began:.0f} s", evidence)
        return evidence

    def measure(self, readings: int) -> Observation:
        """Sweep all channels `readings` times on every instrument at once."""
        due = max(reader.start(readings) for reader in self._readers.values())
        self._wait(due)
        fetched = {name: reader.fetch() for name, reader in self._readers.items()}
        return assemble(fetched, self._bench.sensors, self._bench.temperatures)

    def prepare_environment(self, settings: EnvironmentSettings) -> dict[str, Any]:
        """Bring every chamber to the setpoint and wait until it has settled there; returns the evidence.

        Raises:
            NotSettled: a chamber did not settle in time.

        """
        for name, chamber in self._chambers.items():
            self._guard.check_command(f"{name}_degC", settings.setpoint_degC)
            chamber.set_temperature(settings.setpoint_degC)
        criteria = Criteria(
            settings.setpoint_degC,
            settings.tolerance_degC,
            settings.dwell_s,
            settings.drift_degC_per_h / 3600.0,
            settings.timeout_s,
        )

        def read() -> dict[str, float]:
            return {name: state["temperature_degC"] for name, state in self.environment().items()}

        return self._until_settled(dict.fromkeys(self._chambers, criteria), read, settings.poll_s)

    def park(self, poll_s: float) -> None:
        """Drive every axis to 0 deg, or to the nearest angle the limits allow."""
        span = self._head.axes()
        self.go([{axis: min(max(0.0, low), high) for axis, (low, high) in span.items()}], poll_s)
