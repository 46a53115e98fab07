"""Roles: what the sequencer requires of an instrument of any maker.

A role is a small protocol. A driver is a synchronous class that satisfies one or more of them. Commands return at once
(command, then poll). Only `identify`, `prepare`, `fetch` and `make_safe` may take time, measured by the clock passed to
the driver. Angles are in degrees, temperatures in degrees Celsius, pressures in psi absolute, voltages in volts. A
source and a reader of other quantities say their unit.

A new role is a protocol here. `rig.instruments.opening` asks for it where the bench file names an instrument for it;
`rig.instruments.guarded` passes its commands on.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol, TypeGuard, TypeVar, runtime_checkable

OVERLOAD = 9.9e37
"""The reading that means "outside the range" for SCPI instruments (34401A manual: +9.90000000E+37)."""


def is_overload(reading: float) -> bool:
    """Whether a reading means an overload or no reading.

    Example:
        >>> is_overload(9.9e37), is_overload(float("nan")), is_overload(-10.0)
        (True, True, False)
    """
    return not abs(reading) < 1e37


def any_overload(readings: Sequence[float]) -> bool:
    """Whether any of these readings means an overload or no reading.

    Example:
        >>> any_overload([0.1, OVERLOAD])
        True
    """
    return bool([r for r in readings if not -1e37 < r < 1e37])


@dataclass(frozen=True)
class Identity:
    """Identity of an instrument.

    Attributes:
        maker: as the instrument spells it.
        model: as the instrument spells it.
        serial: its serial number, or "" if it does not report one (a 34401A answers 0).
        firmware: version text, or "".

    Example:
        >>> Identity("HEWLETT-PACKARD", "34401A", "0", "11-5-2").confirmed
        False
    """

    maker: str
    model: str
    serial: str
    firmware: str

    @property
    def confirmed(self) -> bool:
        """Whether the reply alone distinguishes this instrument from others of its model."""
        return self.serial not in ("", "0")


class AxisState(NamedTuple):
    """State of one axis of a head.

    Attributes:
        position_deg: encoder reading.
        moving: whether the controller is still driving towards a target.
        homed: whether the encoder's zero has been found since power-on.
        enabled: whether the drive is powered.
        fault: fault reported by the drive, "" if none.
    """

    position_deg: float
    moving: bool
    homed: bool
    enabled: bool
    fault: str = ""


@dataclass(frozen=True)
class ChamberState:
    """State of a temperature chamber or enclosure.

    Attributes:
        setpoint_degC: the setpoint in force.
        temperature_degC: process value of its own sensor.
        power_pct: control output, -100 (full cooling) to 100 (full heating).
        running: whether closed-loop control is on.
        alarms: its active alarms, empty if none.
    """

    setpoint_degC: float
    temperature_degC: float
    power_pct: float
    running: bool
    alarms: tuple[str, ...] = ()


@dataclass(frozen=True)
class PressureState:
    """State of a pressure controller. Pressures are absolute, psi.

    Attributes:
        setpoint_psia: the setpoint in force.
        pressure_psia: reading of its own reference sensor.
        in_limits: whether the instrument reports the pressure within its in-limits band.
        controlling: whether control is on; if off, it only measures the line.
        venting: whether a vent is under way.
        effort_pct: control effort of its valves, percent; 0 when not controlling.
        faults: its faults (supply pressure lost, vacuum lost), empty if none.
    """

    setpoint_psia: float
    pressure_psia: float
    in_limits: bool
    controlling: bool
    venting: bool
    effort_pct: float
    faults: tuple[str, ...] = ()


@dataclass(frozen=True)
class SourceState:
    """State of a source. Values are in the source's unit.

    Attributes:
        setpoint: the setpoint in force.
        value: its own readback of what it sets; the setpoint if it has none.
        settled: whether the instrument reports that it has arrived; True once a setpoint is accepted, if it cannot say.
        output: whether it is on and under control.
        safe: whether it is in its safe state: output off, or at its declared safe value.
        faults: its faults, empty if none.
    """

    setpoint: float
    value: float
    settled: bool
    output: bool
    safe: bool
    faults: tuple[str, ...] = ()


@runtime_checkable
class Instrument(Protocol):
    """Methods of every instrument."""

    def identify(self) -> Identity:
        """Ask for the identity. Raises `WrongInstrument` if it is not the driver's model, `NoReply` without an
        answer.
        """
        ...

    def prepare(self) -> None:
        """Set remote control, units, ranges and speeds as the bench declares them. Moves nothing."""
        ...

    def make_safe(self) -> None:
        """Bring this instrument to its safe state; idempotent, and called also after errors."""
        ...

    def close(self) -> None:
        """Release the wire; idempotent."""
        ...


@runtime_checkable
class Head(Instrument, Protocol):
    """A dividing head: axes that move to angles."""

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
        """Stop all motion at the axes' normal deceleration; drives stay on."""
        ...


@runtime_checkable
class Reader(Instrument, Protocol):
    """A voltmeter, a scanner or any other meter: takes readings of its channels."""

    def channels(self) -> Sequence[str]:
        """Channel labels in scan order; a single-input meter has one channel, "input"."""
        ...

    def start(self, count: int) -> float:
        """Trigger `count` sweeps over all channels; returns the seconds they are expected to take."""
        ...

    def fetch(self) -> Mapping[str, Sequence[float]]:
        """Collect the readings of the last `start`, by channel, waiting for them if necessary.

        Values are in the instrument's unit (volts, degrees Celsius); an overload stays +-9.9e37.
        """
        ...


@runtime_checkable
class OneAfterAnother(Protocol):
    """A reader that reads its channels one after another, in the order of `channels`; others read all at once."""

    def sweep_s(self) -> float:
        """Duration of one sweep over all channels, seconds."""
        ...


@runtime_checkable
class WithUnits(Protocol):
    """A reader with channels that are not in volts or degrees Celsius."""

    def units(self) -> Mapping[str, str]:
        """Unit of each channel's readings, by channel, as at the end of column names ("mV", "kN", "ohm")."""
        ...


@runtime_checkable
class Chamber(Instrument, Protocol):
    """A temperature chamber or laboratory enclosure."""

    def limits(self) -> tuple[float, float]:
        """Lowest and highest accepted setpoint, degrees Celsius."""
        ...

    def set_temperature(self, degC: float) -> None:
        """Command a setpoint with closed-loop control on. Raises `LimitError` before sending."""
        ...

    def read(self) -> ChamberState:
        """Read its state."""
        ...

    def stop(self) -> None:
        """Hold the present temperature: it becomes the setpoint."""
        ...


@runtime_checkable
class PressureController(Instrument, Protocol):
    """A pressure controller: drives one line to an absolute pressure and measures it."""

    def limits(self) -> tuple[float, float]:
        """Lowest and highest accepted setpoint, psi absolute."""
        ...

    def set_pressure(self, psia: float) -> None:
        """Command a setpoint with control on. Raises `LimitError` before sending."""
        ...

    def read(self) -> PressureState:
        """Read its state."""
        ...

    def stop(self) -> None:
        """Hold the present pressure: it becomes the setpoint."""
        ...

    def vent(self) -> None:
        """Start venting at a limited rate; poll `read` until it no longer vents."""
        ...


@runtime_checkable
class Source(Instrument, Protocol):
    """Sets one quantity of any unit: a voltage or current source, a flow controller, a force machine, a bath."""

    def unit(self) -> str:
        """Its unit as at the end of column names ("V", "kN", "degC"); a factor that it sets has the same unit."""
        ...

    def limits(self) -> tuple[float, float]:
        """Lowest and highest accepted setpoint, in its unit."""
        ...

    def set(self, value: float) -> None:
        """Command a setpoint with the output on. Raises `LimitError` before sending."""
        ...

    def read(self) -> SourceState:
        """Read its state."""
        ...

    def stop(self) -> None:
        """Hold the present value: it becomes the setpoint. Does nothing if the output is off or settled."""
        ...


@runtime_checkable
class ByHand(Instrument, Protocol):
    """A person who sets a factor: hangs up weights, moves a probe. The run asks, and waits for `rig done`."""

    def instruction(self, factor: str, value: float) -> str:
        """The task, to set a factor (with its unit at the end, as in tables) to a value: a sentence without a full
        stop.
        """
        ...


@runtime_checkable
class Typing(Reader, Protocol):
    """A reader without a wire: a person, who types what the run asks for."""

    def take(self, typed: Mapping[str, Sequence[float]]) -> None:
        """Take what was typed for the present point, by channel, in the channels' units; `fetch` returns it."""
        ...


@runtime_checkable
class Restartable(Protocol):
    """An instrument that can detect that its power has been off."""

    def restarted(self) -> bool:
        """Whether it has been powered up since `prepare` last ran. Changes nothing in the instrument except that
        flag.
        """
        ...


@runtime_checkable
class Referenced(Protocol):
    """A head whose zeros can be declared invalid, for example after a drive fault or a slip."""

    def forget_zeros(self) -> None:
        """Make `read` report every axis as not homed, so that `home` finds all zeros again. Moves nothing."""
        ...


@runtime_checkable
class Remarking(Protocol):
    """An instrument that may not support every setting of the bench file."""

    def remarks(self) -> Sequence[str]:
        """Settings of the bench file that are not used, or not as declared, with the consequence; () if none.

        Remarks that follow from the settings alone are known before anything is sent, the others after `prepare`.
        """
        ...


@runtime_checkable
class SelfChecking(Protocol):
    """An instrument that can be asked at any time whether it is set as declared, and well."""

    def wrong(self) -> Sequence[str]:
        """Settings that are not as the bench file declares, and defects: sentences; () if there are none. Changes
        nothing. Raises `DriverError` if it does not say.
        """
        ...


@runtime_checkable
class Learning(Protocol):
    """A reader that learns how its instrument prints readings, and refuses others later."""

    def learned(self) -> Mapping[str, str | int]:
        """Its knowledge so far; {} if there is none."""
        ...

    def recall(self, learned: Mapping[str, str | int]) -> None:
        """Take the knowledge of an earlier session of the run."""
        ...


Role = TypeVar("Role")
_PLAYS: dict[tuple[type, type], bool] = {}


def plays(instrument: Any, role: type[Role]) -> TypeGuard[Role]:
    """Whether an instrument has a role, by its class; to ask a protocol takes as long as an exchange.

    Example:
        >>> plays(object(), Reader)
        False
    """
    pair = type(instrument), role
    if pair not in _PLAYS:
        _PLAYS[pair] = isinstance(instrument, role)
    return _PLAYS[pair]
