"""Actions of the sequencer on a bench: home, go, settle, soak, prepare the environment, park.

Each action sends a command and then polls. Every wait goes through `wait`, so the sequencer can look for signals and
requests. Every action may raise `rig.drivers.errors.DriverError`; further errors are listed at each method.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from rig.drivers.clock import Clock
from rig.drivers.errors import BadReply, NoReply
from rig.drivers.roles import Head, Learning, Remarking, Restartable, SelfChecking
from rig.engine.axes import Axes, AxisReading
from rig.engine.chambers import Chambers
from rig.engine.fault_classes import NotHomed, NotSettled, TemperaturesNotSettled
from rig.engine.guard import Guard
from rig.engine.motion import Arrival, Leg, Move, arrived, delay_of_step
from rig.engine.settling import Criteria, Settling
from rig.engine.sweeps import Sweeps
from rig.instruments.opening import Bench
from rig.procedures.column_names import spelled, stem_of, unit_of
from rig.procedures.plan.conduct import EnvironmentSettings
from rig.procedures.plan.run_list import Settle
from rig.procedures.present.durations import duration

_HOMING_TIMEOUT_S = 900.0
"""A whole turn at a tenth of the usual homing speed, 4 degrees a second."""
_BEARS = 2
"""Consecutive readings that may be lost during a soak before this counts as a fault."""

Watch = Callable[[Mapping[str, float]], None]
"""Called with the values of every poll."""
_JUST_NOW_S = 0.05
"""Age up to which a reading of the axes is the present one."""
_PARKED_DEG = 0.01
"""Distance from its parking position within which an axis of a head is parked."""


class BenchActions:
    """Actions on one bench.

    Args:
        bench: opened instruments.
        axes: everything that moves from point to point.
        guard: limits and interlocks.
        clock: bench time.
        wait: waits for this number of bench seconds; may raise to interrupt the action.

    Attributes:
        arrivals: how each axis reached its present position.
        moves: when each axis left its last setting; an overtravel is no setting.
        chambers: its chambers.
        sweeps: its readers.
        judges: settling judges of the quantities that are waited for, by name; empty at other times.
    """

    def __init__(self, bench: Bench, axes: Axes, guard: Guard, clock: Clock, wait: Callable[[float], None]) -> None:
        self._bench = bench
        self._axes, self._read_axes = axes, axes.reader
        self._guard = guard
        self._clock = clock
        self._wait = wait
        # Looked up once: an isinstance check against a protocol takes longer than most replies.
        self._restartable = {n: i for n, i in bench.instruments.items() if isinstance(i, Restartable)}
        self._self_checking = {n: i for n, i in bench.instruments.items() if isinstance(i, SelfChecking)}
        self._learning = {n: i for n, i in bench.instruments.items() if isinstance(i, Learning)}
        self._axes_seen: Mapping[str, AxisReading] | None = None
        self._controlled = False  # all axes of the last reading
        self._axes_read = -math.inf
        self._commanded: set[str] = set()
        self.arrivals: dict[str, Arrival] = {}
        self.moves: dict[str, Move] = {}
        self.chambers = Chambers(bench, guard, clock)
        self.sweeps = Sweeps(bench, self.positions, guard, clock, wait)
        self.judges: dict[str, Settling] = {}
        self._going: tuple[float, Leg] | None = None  # since when, and where to

    @property
    def axis_names(self) -> Sequence[str]:
        """Axes that instruments move."""
        return tuple(self._axes.span())

    def settling_now(self, seconds: float, most: int) -> dict[str, dict[str, object]]:
        """The quantities that are waited for, by name, each with its instrument; see `Settling.lately`."""
        return {
            name: {"by": self._instrument_of(name), **one.lately(seconds, most)} for name, one in self.judges.items()
        }

    def moving_now(self) -> str:
        """Which axes are on their way, where from and where to, and since when, in words; "" if none is."""
        if self._going is None or self._axes_seen is None:
            return ""
        began, leg = self._going
        told = []
        for axis, target in leg.items():
            reading, by = self._axes_seen[axis], self._instrument_of(axis)
            name, unit = f"{axis} ({by})" if by not in ("", axis) else axis, spelled(unit_of(reading.quantity))
            told.append(f"{name} at {reading.value:.6g} {unit}, on its way to {target:g}")
        return f"{'; '.join(told)}, for {duration(self._clock.now() - began)}"

    def _instrument_of(self, name: str) -> str:
        """The instrument that sets or reads a quantity that settles; "" if none of the bench does."""
        bench = self._bench
        set_by = {stem_of(factor): by for factor, by in bench.config.setters.items()}
        read_by = {column: reader for column, (reader, _) in bench.temperatures.items()}
        own = {one: one for one in bench.instruments}
        found = {**own, **{f"{one}_degC": one for one in own}, **read_by, **set_by}.get(name)
        if found or name not in self.axis_names:
            return found or ""
        return next((one for one, instrument in bench.instruments.items() if isinstance(instrument, Head)), "")

    def rest(self, seconds: float) -> None:
        """Let this bench time pass."""
        self._wait(seconds)

    def stop_motion(self) -> Sequence[str]:
        """Stop all axes; returns outputs that were on, in words. Their direction of arrival is unknown from now on."""
        self._axes_seen = None  # before the command: also if it fails, what was read last is out of date
        found = self._axes.stop()
        self.arrivals.clear()
        return found

    def set_up(self) -> None:
        """Set every instrument as the bench file declares."""
        for instrument in self._bench.instruments.values():
            instrument.prepare()

    def remarks(self) -> list[tuple[str, str]]:
        """Pairs (instrument, bench setting that is not used or not as declared); complete after `set_up`."""
        asked = {name: i for name, i in self._bench.instruments.items() if isinstance(i, Remarking)}
        return [(name, said) for name, instrument in asked.items() for said in instrument.remarks()]

    def restarted(self) -> list[str]:
        """Instruments that report a loss of power since they were last set up."""
        return [name for name, instrument in self._restartable.items() if instrument.restarted()]

    def not_as_declared(self) -> tuple[str, str] | None:
        """The first instrument that is set otherwise than declared, or not well, and what it says; None if all are."""
        for name, instrument in self._self_checking.items():
            if said := instrument.wrong():
                return name, "; ".join(said)
        return None

    def learned(self) -> dict[str, Mapping[str, str | int]]:
        """Knowledge of readers of their instruments, by name."""
        return {name: found for name, reader in self._learning.items() if (found := reader.learned())}

    def recall(self, learned: Mapping[str, Mapping[str, str | int]]) -> None:
        """Give readers their knowledge of earlier sessions."""
        for name in self._learning.keys() & learned.keys():
            self._learning[name].recall(learned[name])

    def axes(self) -> Mapping[str, AxisReading]:
        """Read all axes. Raises the axis' fault, or `LimitViolation` if a limit is violated."""
        readings = self._read_axes()
        self._guard.check_axes(readings)
        if readings is not self._axes_seen:
            self._controlled = True
            for axis, (_, _, _, homed, enabled, fault, _, _) in readings.items():
                if fault:
                    readings[axis].check(axis)
                if not (homed and enabled):
                    self._controlled = False
            self._axes_seen = readings
        self._axes_read = self._clock.now()
        return readings

    def axes_now(self) -> Mapping[str, AxisReading]:
        """All axes as just read, if nothing was commanded since; one reading serves all who look at one moment."""
        if self._axes_seen is not None and self._clock.now() - self._axes_read <= _JUST_NOW_S:
            return self._axes_seen
        return self.axes()

    def positions(self) -> dict[str, float]:
        """Readback of every axis."""
        return {axis: reading.value for axis, reading in self.axes().items()}

    def readback(self) -> dict[str, Any]:
        """Axes and chambers as found. Nothing is commanded or judged."""
        axes = {
            axis: {r.quantity: r.value, "homed": r.homed, "enabled": r.enabled, "fault": r.fault}
            for axis, r in self._axes.read().items()
        }
        return {"axes": axes, "chambers": self.chambers.as_found()}

    def home(self, poll_s: float, *, again: bool = False) -> bool:
        """Home the axes whose zero is unknown, or all axes with `again`; returns whether anything was homed.

        Raises:
            NotHomed: a search took too long, or did not find its zero.

        """
        if not again and all(reading.homed for reading in self.axes().values()):
            return False
        self._axes_seen = None
        self._axes.home(again=again)
        self.arrivals.clear()
        try:
            self._until_still(poll_s, _HOMING_TIMEOUT_S, "homing")
        except NotSettled as error:
            raise NotHomed(f"{error}; look at the head's drives, and its limit and home switches") from error
        lost = [axis for axis, reading in self.axes().items() if not reading.homed]
        if lost:
            raise NotHomed(f"{' and '.join(lost)} did not find home; look at the head's limit and home switches")
        return True

    def go(self, legs: Sequence[Leg], poll_s: float, timeout_s: float) -> None:
        """Drive through the legs. All axes of a leg move together; the side each axis arrives from is noted."""
        left: set[str] = set()
        for leg in legs:
            readings = self.axes_now()
            for axis, target in leg.items():
                reading = readings[axis]
                reading.check(axis, controlled=reading.drive, homed=True)
                self._guard.check_command(reading.quantity, target)
            start = {axis: reading.value for axis, reading in readings.items()}
            for axis in leg:  # before the command: a move that fails half way leaves an unknown side
                self.arrivals.pop(axis, None)
            self._axes_seen = None
            began = self._clock.now()
            self._axes.go(leg)
            self._commanded.update(leg)
            self._going = began, leg
            try:
                trail = self._until_still(poll_s, timeout_s, "moving")
            finally:
                self._going = None
            arrived(leg, start, self.arrivals)
            for axis, target in leg.items():
                if axis not in left and target != start[axis]:  # the first leg leaves the setting; others only arrive
                    left.add(axis)
                    way = [(began, start[axis]), *((t, readings[axis].value) for t, readings in trail)]
                    self.moves[axis] = Move(began + delay_of_step(way, start[axis], target), start[axis])

    def _until_still(self, poll_s: float, timeout_s: float, what: str) -> list[tuple[float, Mapping[str, AxisReading]]]:
        """Wait until no axis moves; returns clock times and readings on the way."""
        began, trail = self._clock.now(), []
        while True:
            self._wait(poll_s)
            readings = self.axes()
            trail.append((self._axes_read, readings))
            if what == "moving":
                self.check_control(readings)
            if True not in [reading.moving for reading in readings.values()]:  # every poll; `any` takes longer
                return trail
            if self._axes_read - began > timeout_s:
                late = {axis: r for axis, r in readings.items() if r.moving}
                at = (f"{axis} at {r.value:g} {spelled(unit_of(r.quantity))}" for axis, r in late.items())
                self.stop_motion()
                raise NotSettled(f"{what} took longer than {timeout_s:g} s ({', '.join(at)})", {}, tuple(late))

    def check_control(self, readings: Mapping[str, AxisReading]) -> None:
        """Raise if an axis has lost control or its zero: it will never arrive. A source that was not set yet is off."""
        if self._controlled:
            return
        for axis, reading in readings.items():
            if reading.drive or axis in self._commanded:
                reading.check(axis, controlled=True, homed=True)

    def settle(self, targets: Mapping[str, float], settings: Callable[[str], Settle], poll_s: float) -> dict[str, Any]:
        """Wait until every axis has settled at its target; returns the evidence. Raises `NotSettled`.

        Args:
            targets: by axis.
            settings: criterion of an axis.
            poll_s: time between readbacks.

        """
        criteria = {
            axis: Criteria(target, s.band, s.dwell_s, s.drift_per_s, s.timeout_s)
            for axis, target in targets.items()
            for s in [settings(axis)]
        }

        shared = [self.axes_now]  # the first look may be the one that ended the motion; every later one is its own

        def read() -> dict[str, float]:
            readings = (shared.pop() if shared else self.axes)()
            self.check_control(readings)
            return {axis: reading.value for axis, reading in readings.items()}

        evidence = self._until_settled(criteria, read, poll_s)
        for axis, (at, start, settled) in list(self.moves.items()):
            if not settled and axis in targets and start != targets[axis]:
                late = delay_of_step(evidence[axis]["samples"], start, targets[axis])
                self.moves[axis] = Move(at + late, start, settled=True)
        return evidence

    def moves_at(self, elapsed_s: float) -> dict[str, tuple[float, float]]:
        """When each axis left its last setting, in elapsed time, and that setting; `elapsed_s` is the present one."""
        now = self._clock.now()
        return {axis: (round(elapsed_s - (now - move.at), 3), move.start) for axis, move in self.moves.items()}

    def _until_settled(
        self,
        criteria: Mapping[str, Criteria],
        read: Callable[[], Mapping[str, float]],
        poll_s: float,
        watch: Watch | None = None,
        late: type[NotSettled] = NotSettled,
        bears: int = 0,
    ) -> dict[str, Any]:
        began = self._clock.now()
        judges = self.judges = {name: Settling(c, began) for name, c in criteria.items()}
        missed = in_a_row = 0
        try:
            while True:
                try:
                    values = read()
                except (NoReply, BadReply):  # one lost reply must not restart hours of settling
                    missed, in_a_row = missed + 1, in_a_row + 1
                    if in_a_row > bears:
                        raise
                    for judge in judges.values():
                        judge.missed(self._clock.now())
                    self._wait(poll_s)
                    continue
                now, in_a_row = self._clock.now(), 0
                if watch is not None:
                    watch(values)
                outcomes = {name: judge.add(now, values[name]) for name, judge in judges.items()}
                if "waiting" not in outcomes.values():
                    self._wait(0.0)  # a gap in time is no evidence of settling
                    break
                polls = 1
                if self._bench.forecast:  # a rehearsal, which may pass over polls that decide nothing
                    polls = max(1, int(max(judge.idle_s() for judge in judges.values()) / poll_s))
                self._wait(poll_s * polls)
        finally:
            self.judges = {}
        evidence = {name: judge.evidence() | ({"missed": missed} if missed else {}) for name, judge in judges.items()}
        failed = {
            name: f"{name} {outcomes[name]} after {now - began:.0f} s (it reads {values[name]:.6g}, "
            f"and within {c.band:g} of {c.target:g} is asked)"
            for name, c in criteria.items()
            if outcomes[name] != "settled"
        }
        if failed:
            raise late(", ".join(failed.values()), evidence, tuple(failed))
        return evidence

    def until_soaked(
        self,
        criteria: Mapping[str, Criteria],
        poll_s: float,
        thermometers: Sequence[str],
        watch: Watch | None = None,
    ) -> dict[str, Any]:
        """Wait until chambers and thermometers have settled; returns the evidence.

        Args:
            criteria: by chamber name and by temperature column.
            poll_s: time between readbacks.
            thermometers: which of them are temperature columns.
            watch: called with the values of every poll; None if nobody is.

        Raises:
            TemperaturesNotSettled: something did not settle in time.

        """

        def read() -> dict[str, float]:
            chambers = {name: state["temperature_degC"] for name, state in self.chambers.read().items()}
            return chambers | self.sweeps.temperatures(thermometers)

        return self._until_settled(criteria, read, poll_s, watch, TemperaturesNotSettled, _BEARS)

    def prepare_environment(self, settings: EnvironmentSettings) -> dict[str, Any]:
        """Bring every chamber to the setpoint and wait until it has settled there; returns the evidence.

        Raises:
            TemperaturesNotSettled: a chamber did not settle in time.

        """
        for name in self.chambers.names:
            self.chambers.set(name, settings.setpoint_degC)
        s = settings
        criteria = Criteria(s.setpoint_degC, s.tolerance_degC, s.dwell_s, s.drift_degC_per_h / 3600.0, s.timeout_s)
        return self.until_soaked(dict.fromkeys(self.chambers.names, criteria), settings.poll_s, ())

    def park(self, poll_s: float, timeout_s: float) -> None:
        """Drive every axis to its parking position, as near as the limits allow; one that stands there is left alone.

        A command to stay would be another setting of an angle that is held for a whole plot.
        Axes that lost their zeros, for example in a power cut after the last point, stay where they are: nothing is
        left to do that justifies homing.
        """
        parking = self._axes.parking()
        if not parking:
            return
        readings = self.axes()
        away = {axis: target for axis, target in parking.items() if abs(readings[axis].value - target) > _PARKED_DEG}
        if away and all(reading.homed for reading in readings.values()):
            self.go([away], poll_s, timeout_s)
