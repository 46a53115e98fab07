"""What the sequencer needs of an instrument, whoever made it.

A role is a small protocol. A driver is a plain synchronous class that satisfies one or more of them. Commands
return at once (command, then poll); only `identify`, `prepare`, `fetch` and `make_safe` may take time, and they
take it from the clock that was handed in. All angles are degrees, temperatures degrees Celsius, pressures psi
absolute, voltages volts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

OVERLOAD = 9.9e37
"""The reading by which SCPI instruments say "outside the range" (34401A manual: +9.90000000E+37)."""


def is_overload(reading: float) -> bool:
    """Whether a reading is the instrument's way of saying that it cannot tell."""
    return not abs(reading) < 1e37


@dataclass(frozen=True)
class Identity:
    """Who answered.

    Attributes:
        maker: as the instrument spells it.
        model: as the instrument spells it.
        serial: its serial number, or "" where it does not tell (a 34401A answers 0).
        firmware: version text, or "".

    """

    maker: str
    model: str
    serial: str
    firmware: str

    @property
    def confirmed(self) -> bool:
        """Whether the reply alone tells this instrument from another of its model."""
        return self.serial not in ("", "0")


@dataclass(frozen=True)
class AxisState:
    """One axis of a head at one moment.

    Attributes:
        position_deg: encoder readback.
        moving: the controller is still driving towards a target.
        homed: the encoder's zero has been found since power-on.
        enabled: the drive is powered.
        fault: what the drive complains of, "" if nothing.

    """

    position_deg: float
    moving: bool
    homed: bool
    enabled: bool
    fault: str = ""


@dataclass(frozen=True)
class ChamberState:
    """A temperature chamber or enclosure at one moment.

    Attributes:
        setpoint_degC: the setpoint in force.
        temperature_degC: process value of its own sensor.
        power_pct: control output, -100 (full cooling) to 100 (full heating).
        running: closed-loop control is on.
        alarms: what it complains of, empty if nothing.

    """

    setpoint_degC: float
    temperature_degC: float
    power_pct: float
    running: bool
    alarms: tuple[str, ...] = ()


@dataclass(frozen=True)
class PressureState:
    """A pressure controller at one moment. Pressures are absolute, psi.

    Attributes:
        setpoint_psia: the setpoint in force.
        pressure_psia: reading of its own reference sensor.
        in_limits: the instrument itself calls the pressure settled within its in-limits band.
        controlling: its output is on; off, the line is only measured.
        venting: a vent is under way.
        effort_pct: how hard its valves work, percent; 0 when not controlling.
        faults: what it complains of (supply pressure lost, vacuum lost), empty if nothing.

    """

    setpoint_psia: float
    pressure_psia: float
    in_limits: bool
    controlling: bool
    venting: bool
    effort_pct: float
    faults: tuple[str, ...] = ()


class Instrument(Protocol):
    """What every instrument can do."""

    def identify(self) -> Identity:
        """Ask who answers. Raises `WrongInstrument` if it is not the driver's model, `NoReply` if nobody."""
        ...

    def prepare(self) -> None:
        """Bring settings (remote control, units, ranges, speeds) to what the bench declares. Moves nothing."""
        ...

    def make_safe(self) -> None:
        """Bring this instrument to its safe state; idempotent, and tried even after errors."""
        ...

    def close(self) -> None:
        """Release the wire; idempotent."""
        ...


@runtime_checkable
class Head(Instrument, Protocol):
    """A dividing head: axes that go to angles."""

    def axes(self) -> Mapping[str, tuple[float, float]]:
        """Axis name ("pitch", "roll") to its (low, high) limits in degrees."""
        ...

    def home(self) -> None:
        """Start homing every axis that is not homed; poll `read` until all are homed and none moves."""
        ...

    def move(self, targets_deg: Mapping[str, float]) -> None:
        """Start moving the named axes to absolute angles, together. Raises `LimitError` before sending."""
        ...

    def read(self) -> Mapping[str, AxisState]:
        """Read every axis."""
        ...

    def stop(self) -> None:
        """Stop all motion at the axes' normal deceleration, drives staying on."""
        ...


@runtime_checkable
class Reader(Instrument, Protocol):
    """A voltmeter or scanner: takes readings of its channels."""

    def channels(self) -> Sequence[str]:
        """Channel labels in scan order; a single-input meter has one channel, "input"."""
        ...

    def start(self, count: int) -> float:
        """Trigger `count` sweeps over all channels; returns the seconds they are expected to take."""
        ...

    def fetch(self) -> Mapping[str, Sequence[float]]:
        """Collect the readings of the last `start`, by channel, waiting for them if need be.

        Values are the instrument's own (volts, degrees Celsius); an overload stays +-9.9e37.
        """
        ...


@runtime_checkable
class Chamber(Instrument, Protocol):
    """A temperature chamber or laboratory enclosure."""

    def limits(self) -> tuple[float, float]:
        """Lowest and highest setpoint it accepts, degrees Celsius."""
        ...

    def set_temperature(self, degC: float) -> None:
        """Command a setpoint with closed-loop control on. Raises `LimitError` before sending."""
        ...

    def read(self) -> ChamberState:
        """Read its state."""
        ...

    def stop(self) -> None:
        """Hold where it is: the setpoint becomes the present temperature."""
        ...


@runtime_checkable
class PressureController(Instrument, Protocol):
    """A pressure controller: drives one line to an absolute pressure and measures it."""

    def limits(self) -> tuple[float, float]:
        """Lowest and highest setpoint it accepts, psi absolute."""
        ...

    def set_pressure(self, psia: float) -> None:
        """Command a setpoint with control on. Raises `LimitError` before sending."""
        ...

    def read(self) -> PressureState:
        """Read its state."""
        ...

    def stop(self) -> None:
        """Hold where it is: the setpoint becomes the present pressure."""
        ...

    def vent(self) -> None:
        """Start venting at a limited rate; poll `read` until it no longer vents."""
        ...


@runtime_checkable
class Restartable(Protocol):
    """An instrument that can tell whether its power has been off."""

    def restarted(self) -> bool:
        """Whether it has been powered up since `prepare` last ran. Changes nothing in the instrument but that flag."""
        ...


@runtime_checkable
class Referenced(Protocol):
    """A head that can be told that its zeros are not to be trusted any more, as after a drive fault or a slip."""

    def forget_zeros(self) -> None:
        """Have `read` report every axis as not homed, so that `home` finds all zeros again. Moves nothing."""
        ...


@runtime_checkable
class Remarking(Protocol):
    """An instrument that may have to do without something that the bench file asks for."""

    def remarks(self) -> Sequence[str]:
        """What of the bench file is not used or not as declared, and what that costs; () if nothing.

        What the settings alone tell is known before anything is sent, the rest after `prepare`.
        """
        ...
