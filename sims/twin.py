"""What a twin is: what the simulated bench needs of it, whoever wrote it.

A twin is the simulated counterpart of one instrument, found by the name of its driver (entry points of group
`rig.twins`). Whatever others have to know of it are attributes of its class.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, Protocol, runtime_checkable

from sims.wires.serial_line import SerialEnd

if TYPE_CHECKING:
    from sims.faults.fault import Kind
    from sims.inputs import Inputs
    from sims.wires.modbus_slave import Registers
    from sims.world import World

Medium = Literal["serial", "modbus", "can"]
"""What a wire carries."""

Role = Literal["head", "reader", "chamber", "pressure-controller"]
"""What of the plant an instrument moves or reads."""


class TwinClass(Protocol):
    """What an entry point of group `rig.twins` names; also true of the twins made of it.

    Attributes:
        wire: what it talks over; each has a protocol here.
        roles: "head": it moves the plant's head; "chamber": it controls `plant.chamber(name)`; "pressure-controller":
            `plant.pressure_line(name)`, and what it reads of it goes through its `inputs`; "reader": it reads
            sensors, through its `inputs` (`Measuring`), and is `Accurate`.
        faults: what may happen to it besides the faults of its wire and its power.

    """

    @property
    def wire(self) -> Medium:
        """See above."""
        ...

    @property
    def roles(self) -> frozenset[Role]:
        """See above."""
        ...

    @property
    def faults(self) -> tuple[Kind, ...]:
        """See above."""
        ...


class MakesTwins(TwinClass, Protocol):
    """The same, called."""

    def __call__(
        self, name: str, options: Mapping[str, object], world: World, plant: Any, serial: str
    ) -> SerialTwin | ModbusTwin | CanTwin:
        """Make the twin.

        Args:
            name: the bench's name for the instrument.
            options: its table in the bench file, without what is the bench's own.
            world: virtual time.
            plant: a `sims.physics.Plant`.
            serial: serial number to answer with.

        """
        ...


class Twin(TwinClass, Protocol):
    """A simulated instrument."""

    name: str

    def power_cycle(self) -> None:
        """Off and on again: what the instrument forgets without power is forgotten."""
        ...


class SerialTwin(Twin, SerialEnd, Protocol):
    """One on a serial line; `frame` is data bits, parity, stop bits, such as "8N1"."""


class ModbusTwin(Twin, Protocol):
    """One that is registers; with `ports` of them ("tcp", "rtu") where these differ."""

    @property
    def registers(self) -> Registers:
        """What is on the wire, for any framing."""
        ...


class CanTwin(Twin, Protocol):
    """One on a CAN bus."""

    def on_frame(self, can_id: int, data: bytes, tx: Callable[[int, bytes], None]) -> None:
        """Take a frame from the bus; its own go to `tx`, now or later."""
        ...


@runtime_checkable
class Measuring(Protocol):
    """A twin whose readings can go wrong, and are on the tape."""

    inputs: Inputs


@dataclass(frozen=True)
class Accuracy:
    """How far what an instrument says may be from what is at its input, sensor noise apart.

    Attributes:
        adds: six standard deviations of its own noise and half the last digit it converts to, V or degC.
        digit: half the last digit that it sends, where that is less than nine significant ones; V or degC.

    """

    adds: float
    digit: float = 0.0


@runtime_checkable
class Accurate(Protocol):
    """A reader that says how well it reads, so that others can tell a true reading from a wrong one."""

    def accuracy(self, channel: str, unit: str) -> Accuracy:
        """Of readings of an input; `unit` is "V" or "degC"."""
        ...
