"""Everything that moves from point to point, as axes: angles of a head, pressure of a controller.

The sequencer commands axes and polls them. This module translates them to the roles of instruments.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Protocol

from drivers.errors import DriverError, InstrumentError, NotReady
from drivers.roles import Chamber, Head, PressureController, Referenced
from procedures.run_list import Factor, RunList
from rig.bench import Bench
from rig.engine.fault_classes import DriveFault, NotHomed, SupplyFailure
from rig.quantities import HEAD_AXES, PRESSURE


@dataclass(frozen=True)
class AxisReading:
    """One axis at one moment.

    Attributes:
        quantity: name with its unit, as in limits and tables.
        value: readback, in that unit.
        moving: still under way to its target.
        homed: its zero is known since power-on.
        enabled: it is under control.
        fault: fault reported by its instrument, "" if none.

    """

    quantity: str
    value: float
    moving: bool
    homed: bool
    enabled: bool
    fault: str

    def check(self, axis: str, *, controlled: bool = False, homed: bool = False) -> None:
        """Raise the fault its instrument reports.

        Args:
            axis: its name.
            controlled: whether it must be under control.
            homed: whether its zero must be known.

        Raises:
            DriveFault: a drive reports a fault, or is off.
            SupplyFailure: a pressure controller reports a fault of its supply.
            InstrumentError: a pressure is not under control.
            NotHomed: its zero is not known.

        """
        pressure = self.quantity == PRESSURE
        if self.fault:
            raise (SupplyFailure if pressure else DriveFault)(axis, 0, self.fault)
        if controlled and not self.enabled:
            words = "control is off; was it switched off, or without power?"
            raise (InstrumentError if pressure else DriveFault)(axis, 0, words)
        if homed and not self.homed:
            raise NotHomed(f"{axis} has lost its zero: was its controller without power?")


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

    def stop(self) -> None:
        """Stop at the present position."""
        ...

    def home(self, *, again: bool = False) -> None:
        """Start homing axes of unknown zero; all axes if `again`."""
        ...

    def parking(self) -> Mapping[str, float]:
        """Parking position by axis; {} if the safe state is enough."""
        ...


@contextmanager
def _of_the_drive() -> Iterator[None]:
    """Raise a refused command of the head as a fault of its drives."""
    try:
        yield
    except (InstrumentError, NotReady) as error:
        raise DriveFault("head", 0, str(error)) from error


class HeadMover:
    """A dividing head's axes."""

    def __init__(self, head: Head) -> None:
        self._head = head

    def span(self) -> Mapping[str, tuple[float, float]]:
        """See `Mover`."""
        return self._head.axes()

    def read(self) -> Mapping[str, AxisReading]:
        """See `Mover`."""
        return {
            axis: AxisReading(f"{axis}_deg", s.position_deg, s.moving, s.homed, s.enabled, s.fault)
            for axis, s in self._head.read().items()
        }

    def go(self, targets: Mapping[str, float]) -> None:
        """See `Mover`."""
        with _of_the_drive():
            self._head.move(targets)

    def stop(self) -> None:
        """See `Mover`."""
        self._head.stop()

    def home(self, *, again: bool = False) -> None:
        """See `Mover`."""
        with _of_the_drive():
            if again and isinstance(self._head, Referenced):
                self._head.forget_zeros()
            self._head.home()

    def parking(self) -> Mapping[str, float]:
        """0 deg, or the nearest angle the axis can reach."""
        return {axis: min(max(0.0, low), high) for axis, (low, high) in self._head.axes().items()}


class PressureMover:
    """A pressure controller's one axis. Its readback is the reference the sensors are calibrated against."""

    def __init__(self, controller: PressureController) -> None:
        self._controller = controller

    def span(self) -> Mapping[str, tuple[float, float]]:
        """See `Mover`."""
        return {"pressure": self._controller.limits()}

    def read(self) -> Mapping[str, AxisReading]:
        """See `Mover`."""
        s = self._controller.read()
        moving = s.venting or (s.controlling and not s.in_limits)
        reading = AxisReading(PRESSURE, s.pressure_psia, moving, True, s.controlling, "; ".join(s.faults))
        return {"pressure": reading}

    def go(self, targets: Mapping[str, float]) -> None:
        """See `Mover`."""
        self._controller.set_pressure(targets["pressure"])

    def stop(self) -> None:
        """Hold the present pressure while it is changing; a settled or uncontrolled pressure is left alone."""
        state = self._controller.read()
        if state.controlling and not state.in_limits:
            self._controller.stop()

    def home(self, *, again: bool = False) -> None:
        """Does nothing: a reference sensor has no zero to find."""

    def parking(self) -> Mapping[str, float]:
        """None: venting belongs to the safe state."""
        return {}


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

    def read(self) -> dict[str, AxisReading]:
        """Read every axis."""
        return {axis: reading for mover in self._movers for axis, reading in mover.read().items()}

    def go(self, targets: Mapping[str, float]) -> None:
        """Start moving the named axes, together."""
        for mover in self._movers:
            own = {axis: target for axis, target in targets.items() if self._mover[axis] is mover}
            if own:
                mover.go(own)

    def stop(self) -> None:
        """Stop every axis, also after one of them fails. Raises the first error at the end."""
        failed: list[DriverError] = []
        for mover in self._movers:
            try:
                mover.stop()
            except DriverError as error:
                failed.append(error)
        if failed:
            raise failed[0]

    def home(self, *, again: bool = False) -> None:
        """Start homing axes of unknown zero; all axes if `again`."""
        for mover in self._movers:
            mover.home(again=again)

    def parking(self) -> dict[str, float]:
        """Parking position by axis."""
        return {axis: target for mover in self._movers for axis, target in mover.parking().items()}


def axes_of(bench: Bench, factors: Sequence[Factor]) -> Axes:
    """The axes of these factors on a bench. Raises `ConfigurationError` for a factor that nothing moves."""
    movers: list[Mover] = []
    if any(f.axis in HEAD_AXES for f in factors):
        movers.append(HeadMover(bench.head))
    if any(f.axis == "pressure" for f in factors):
        movers.append(PressureMover(bench.setting(PRESSURE, PressureController)[1]))
    return Axes(movers)


def own_limits(bench: Bench, run_list: RunList) -> dict[str, tuple[float, float]]:
    """The instruments' own (low, high) by factor name."""
    span = axes_of(bench, run_list.easy).span()
    found = {f.name: span[f.axis] for f in run_list.easy if f.axis in span}
    return found | {f.name: bench.setting(f.name, Chamber)[1].limits() for f in run_list.hard}
