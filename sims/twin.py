"""Twins: requirements of the simulated bench on any twin.

A twin is the simulated counterpart of one instrument, found by the name of its driver (entry points of group
`rig.twins`). Further properties are attributes of its class.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, Protocol, runtime_checkable

from rig.sims.wires.serial_line import SerialEnd

if TYPE_CHECKING:
    from rig.sims.fault import Kind
    from rig.sims.inputs import Inputs
    from rig.sims.wires.modbus_slave import Registers
    from rig.sims.world import World

Medium = Literal["serial", "modbus", "can", "none"]
"""Kind of wire."""

Role = Literal["head", "reader", "chamber", "pressure-controller", "source"]
"""Part of the plant that an instrument moves or reads."""


class TwinClass(Protocol):
    """The object named by an entry point of group `rig.twins`; its attributes also hold for its instances.

    Attributes:
        wire: its wire; each has a protocol here.
        roles: "head": it moves the plant's head; "chamber": it controls `plant.chamber(name)`; "pressure-controller":
            it controls `plant.pressure_line(name)`, and its readings of it pass through its `inputs`; "source": it sets
            `plant.source(name)`; "reader": it
            reads sensors through its `inputs` (`Measuring`), and is `Accurate`.
        faults: possible faults besides those of its wire and its power.
    """

    @property
    def wire(self) -> Medium:
        """Kind of its wire."""
        ...

    @property
    def roles(self) -> frozenset[Role]:
        """Parts of the plant that it moves, controls or reads."""
        ...

    @property
    def faults(self) -> tuple[Kind, ...]:
        """Possible faults besides those of its wire and its power."""
        ...


class MakesTwins(TwinClass, Protocol):
    """A class of twins that can be called to make one."""

    def __call__(self, name: str, options: Mapping[str, object], world: World, plant: Any, serial: str) -> Twin:
        """Make the twin.

        Args:
            name: the bench's name for the instrument.
            options: its table in the bench file, without the bench's own keys.
            world: virtual time.
            plant: a `rig.sims.physics.Plant`.
            serial: its serial number.
        """
        ...


class Twin(TwinClass, Protocol):
    """A simulated instrument."""

    name: str

    def power_cycle(self) -> None:
        """Power off and on: volatile state of the instrument is lost."""
        ...


class SerialTwin(Twin, SerialEnd, Protocol):
    """A twin on a serial line; `frame` is data bits, parity, stop bits, such as "8N1"."""


class ModbusTwin(Twin, Protocol):
    """A twin with registers; with `ports` of them ("tcp", "rtu") if these differ."""

    @property
    def registers(self) -> Registers:
        """The registers, for any framing."""
        ...


class CanTwin(Twin, Protocol):
    """A twin on a CAN bus."""

    def on_frame(self, can_id: int, data: bytes, tx: Callable[[int, bytes], None]) -> None:
        """Take a frame from the bus; its own frames go to `tx`, now or later."""
        ...


@runtime_checkable
class Measuring(Protocol):
    """A twin whose readings can have faults and are on the tape."""

    inputs: Inputs


@runtime_checkable
class Changing(Protocol):
    """A twin that a person may change by hand."""

    def by_hand(self, change: str, number: float | None) -> None:
        """A person has changed the bench, by the word of a procedure file, and states this number, if any."""
        ...


@dataclass(frozen=True)
class Accuracy:
    """Maximum deviation of reported values from the input, without sensor noise.

    Attributes:
        adds: six standard deviations of its own noise plus half the last digit of its converter, V or degC.
        digit: half the last digit that it sends, if it sends less than nine significant ones; V or degC.
    """

    adds: float
    digit: float = 0.0


@runtime_checkable
class Accurate(Protocol):
    """A reader with known accuracy, so that checkers can distinguish true readings from wrong ones."""

    def accuracy(self, channel: str, unit: str) -> Accuracy:
        """Accuracy of readings of an input; `unit` is "V" or "degC"."""
        ...
