"""Everything that moves from point to point, as axes: angles of a head, a controller's pressure, a source's quantity.

The sequencer commands axes and polls them. This module translates them to the roles of instruments.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import isfinite
from typing import Any, NamedTuple, Protocol

from rig.drivers.errors import DriverError, InstrumentError, NotReady
from rig.drivers.roles import AxisState, Head, PressureController, Referenced
from rig.engine.fault_classes import DriveFault, NotHomed, SupplyFailure
from rig.procedures.column_names import stem_of, unit_of
from rig.procedures.plan.run_list import Factor

CHAMBER_MARGIN_DEGC = 2.0
"""Difference by which a chamber may pass a limit, which overshoots a setpoint at it before it settles."""
_MARGIN = 0.01
"""Difference by which a source may pass a limit while it settles there, as a fraction of its range."""


class AxisReading(NamedTuple):
    """One axis at one moment.

    Attributes:
        quantity: name with its unit, as in limits and tables.
        value: readback, in that unit.
        moving: still under way to its target.
        homed: its zero is known since power-on.
        enabled: it is under control.
        fault: fault reported by its instrument, "" if none.
        drive: whether a drive moves it, which is under control also while it stands; other instruments begin to control
            at a command.
        margin: difference by which a readback may pass a limit, in its unit, while it is set to the limit.

    """

    quantity: str
    value: float
    moving: bool
    homed: bool
    enabled: bool
    fault: str
    drive: bool = True
    margin: float = 0.05

    def check(self, axis: str, *, controlled: bool = False, homed: bool = False) -> None:
        """Raise the fault its instrument reports.

        Args:
            axis: its name.
            controlled: whether it must be under control.
            homed: whether its zero must be known.

        Raises:
            DriveFault: a drive reports a fault, or is off.
            SupplyFailure: a pressure controller or a source reports a fault.
            InstrumentError: what it sets is not under control.
            NotHomed: its zero is not known.

        """
        if self.fault:
            raise (DriveFault if self.drive else SupplyFailure)(axis, 0, self.fault)
        if controlled and not self.enabled:
            words = "control is off; was it switched off, or without power?"
            raise (DriveFault if self.drive else InstrumentError)(axis, 0, words)
        if homed and not self.homed:
            raise NotHomed(f"{axis} has lost its zero: was its controller without power?")


_OF_A_DRIVE = (True, 0.05)
"""`drive` and `margin` of an axis of a head: while it is set to a limit it may pass it by 0.05 deg. Chosen."""


def _found_on(name: str, value: float, setpoint: float, *, holds: bool) -> str:
    """An output that was found on, with what became of it; `name` of what it sets, with its unit."""
    did = f"its setpoint was made {value:g}, so that it stops there" if holds else "it was left so"
    return f"{stem_of(name)} was found on at {value:g} {unit_of(name)}, with a setpoint of {setpoint:g}; {did}"


class Mover(Protocol):
    """An instrument that moves one or more axes."""

    def span(self) -> Mapping[str, tuple[float, float]]:
        """The instrument's own (low, high) by axis."""
        ...

    def read(self) -> Mapping[str, AxisReading]:
        """Read every axis."""
        ...

    def go(self, targets: Mapping[str, float]) -> None:
        """Start moving the named axes, together."""
        ...

    def stop(self) -> str:
        """Stop at the present position. Returns an output that was on and what became of it, in words; "" for none."""
        ...

    def home(self, *, again: bool = False) -> None:
        """Start homing axes of unknown zero; all axes if `again`."""
        ...

    def parking(self) -> Mapping[str, float]:
        """Parking position by axis; {} if the safe state is enough."""
        ...


class HeadMover:
    """A dividing head's axes."""

    def __init__(self, head: Head) -> None:
        self._head = head
        self._states: Mapping[str, AxisState] = {}
        self._readings: Mapping[str, AxisReading] = {}

    def span(self) -> Mapping[str, tuple[float, float]]:
        """The instrument's own (low, high) by axis."""
        return self._head.axes()

    def read(self) -> Mapping[str, AxisReading]:
        """Read every axis."""
        states = self._head.read()
        if states != self._states:
            new = tuple.__new__  # in half the time of the class; a state's fields are those after the name
            self._states = states
            self._readings = {
                axis: new(AxisReading, (axis + "_deg", *state, *_OF_A_DRIVE)) for axis, state in states.items()
            }
        return self._readings

    def go(self, targets: Mapping[str, float]) -> None:
        """Start moving the named axes, together."""
        try:
            self._head.move(targets)
        except (InstrumentError, NotReady) as error:  # a refused command is a fault of its drives
            raise DriveFault("head", 0, str(error)) from error

    def stop(self) -> str:
        """Stop at the present position. A head puts nothing out."""
        self._head.stop()
        return ""

    def home(self, *, again: bool = False) -> None:
        """Start homing axes of unknown zero; all axes if `again`."""
        try:
            if again and isinstance(self._head, Referenced):
                self._head.forget_zeros()
            self._head.home()
        except (InstrumentError, NotReady) as error:
            raise DriveFault("head", 0, str(error)) from error

    def parking(self) -> Mapping[str, float]:
        """0 deg, or the nearest angle the axis can reach."""
        return {axis: min(max(0.0, low), high) for axis, (low, high) in self._head.axes().items()}


class PressureMover:
    """A pressure controller's one axis. Its readback is the reference the sensors are calibrated against."""

    def __init__(self, controller: PressureController, factor: Factor) -> None:
        self._controller, self._axis, self._quantity = controller, factor.axis, factor.name

    def span(self) -> Mapping[str, tuple[float, float]]:
        """The instrument's own (low, high) by axis."""
        return {self._axis: self._controller.limits()}

    def read(self) -> Mapping[str, AxisReading]:
        """Read every axis."""
        s = self._controller.read()
        # A line without control goes nowhere: waiting for it would only end by the timeout.
        moving = s.venting or (s.controlling and not s.in_limits)
        faults = "; ".join(s.faults)
        return {
            self._axis: AxisReading(self._quantity, s.pressure_psia, moving, True, s.controlling, faults, drive=False)
        }

    def go(self, targets: Mapping[str, float]) -> None:
        """Start moving the named axes, together."""
        self._controller.set_pressure(targets[self._axis])

    def stop(self) -> str:
        """Hold the present pressure while it is changing; a settled or uncontrolled pressure is left alone."""
        state = self._controller.read()
        holds = state.controlling and not state.in_limits
        if holds:
            self._controller.stop()
        return (
            _found_on(self._quantity, state.pressure_psia, state.setpoint_psia, holds=holds)
            if state.controlling
            else ""
        )

    def home(self, *, again: bool = False) -> None:
        """Does nothing: a reference sensor has no zero to find."""

    def parking(self) -> Mapping[str, float]:
        """None: venting belongs to the safe state."""
        return {}


class _Kept:
    """An instrument that keeps one quantity, and has no zero to find and nowhere to park."""

    def __init__(self, instrument: Any, factor: Factor) -> None:
        self._instrument, self._axis, self._quantity = instrument, factor.axis, factor.name

    def span(self) -> Mapping[str, tuple[float, float]]:
        """The instrument's own (low, high) by axis."""
        return {self._axis: self._instrument.limits()}

    def home(self, *, again: bool = False) -> None:
        """Does nothing."""

    def parking(self) -> Mapping[str, float]:
        """None: what is left at the end belongs to the safe state."""
        return {}


class SourceMover(_Kept):
    """A source's one axis. Within `band` of its setting it does not change."""

    def __init__(self, instrument: Any, factor: Factor, band: float) -> None:
        super().__init__(instrument, factor)
        self._band = band

    def read(self) -> Mapping[str, AxisReading]:
        """Read every axis."""
        s = self._instrument.read()
        low, high = self._instrument.limits()
        moving, faults = s.output and not s.settled, "; ".join(s.faults)
        margin = _MARGIN * (high - low) if isfinite(high - low) else _MARGIN * abs(s.setpoint)
        return {
            self._axis: AxisReading(self._quantity, s.value, moving, True, s.output, faults, drive=False, margin=margin)
        }

    def go(self, targets: Mapping[str, float]) -> None:
        """Start moving the named axes, together."""
        self._instrument.set(targets[self._axis])

    def stop(self) -> str:
        """Hold the present value while it is changing; a source at its setting, or one that is off, is left alone."""
        state = self._instrument.read()
        holds = state.output and not state.settled and abs(state.value - state.setpoint) > self._band
        if holds:
            self._instrument.stop()
        return _found_on(self._quantity, state.value, state.setpoint, holds=holds) if state.output else ""


class ChamberMover(_Kept):
    """A chamber's one axis, for a temperature that is changed from point to point."""

    def read(self) -> Mapping[str, AxisReading]:
        """Read every axis. Its alarms are judged with those of all chambers."""
        s = self._instrument.read()
        where = s.temperature_degC, False, True, s.running, ""
        return {self._axis: AxisReading(self._quantity, *where, drive=False, margin=CHAMBER_MARGIN_DEGC)}

    def go(self, targets: Mapping[str, float]) -> None:
        """Start moving the named axes, together."""
        self._instrument.set_temperature(targets[self._axis])

    def stop(self) -> str:
        """Nothing moves: it keeps its setpoint. Whether it is on is told by its own readback."""
        return ""


class Axes:
    """All axes of a bench.

    Args:
        movers: instruments that move them; no axis has two movers.

    """

    def __init__(self, movers: Sequence[Mover]) -> None:
        self._movers = movers
        self._mover = {axis: mover for mover in movers for axis in mover.span()}

    def span(self) -> dict[str, tuple[float, float]]:
        """The instruments' own (low, high) by axis."""
        return {axis: limits for mover in self._movers for axis, limits in mover.span().items()}

    @property
    def reader(self) -> Callable[[], Mapping[str, AxisReading]]:
        """What reads every axis, for callers that read often."""
        return self._movers[0].read if len(self._movers) == 1 else self.read

    def read(self) -> Mapping[str, AxisReading]:
        """Read every axis."""
        found: dict[str, AxisReading] = {}
        for mover in self._movers:
            found.update(mover.read())
        return found

    def go(self, targets: Mapping[str, float]) -> None:
        """Start moving the named axes, together."""
        for mover in self._movers:
            own = {axis: target for axis, target in targets.items() if self._mover[axis] is mover}
            if own:
                mover.go(own)

    def stop(self) -> Sequence[str]:
        """Stop every axis, also after one of them fails; see `Mover.stop`. Raises the first error at the end."""
        failed: list[DriverError] = []
        found: list[str] = []
        for mover in self._movers:
            try:
                found.append(mover.stop())
            except DriverError as error:
                failed.append(error)
        if failed:
            raise failed[0]
        return [said for said in found if said]

    def home(self, *, again: bool = False) -> None:
        """Start homing axes of unknown zero; all axes if `again`."""
        for mover in self._movers:
            mover.home(again=again)

    @property
    def movers(self) -> Sequence[Mover]:
        """What moves them."""
        return self._movers

    def parking(self) -> dict[str, float]:
        """Parking position by axis."""
        return {axis: target for mover in self._movers for axis, target in mover.parking().items()}
