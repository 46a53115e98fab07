"""Drivers: what the controller requires of a driver's class.

A driver is found by its name in entry-point group `rig.drivers` of `pyproject.toml`, its twin in `rig.twins`. It
satisfies one or more protocols of `rig.drivers.roles`; further properties are attributes of its class.
"""

from __future__ import annotations

from typing import Any, Literal, NamedTuple, Protocol

from pydantic import BaseModel

from rig.drivers.clock import Clock
from rig.drivers.roles import Instrument
from rig.drivers.wires import Wires

Medium = Literal["serial", "modbus", "can", "bridge", "none"]
"""Kind of wire; "bridge" for what another library reaches, "none" for a person.

It determines which addresses are valid (`rig.drivers.wires.addresses`).
"""


class ContractFile(NamedTuple):
    """A file that both sides of a wire use, such as an EDS, a DBC, a register map; driver and twin get the same text.

    Attributes:
        option: option of driver and twin that takes the text; a bench file may name another file there.
        package: importable package that contains the file.
        file: its name there.
    """

    option: str
    package: str
    file: str


class DriverClass(Protocol):
    """The object named by an entry point of group `rig.drivers`.

    Attributes:
        Options: options of the instrument in the bench file; checks them.
        wire: kind of its wire.
        contracts: required files, () if there are none.
    """

    Options: type[BaseModel]

    @property
    def wire(self) -> Medium:
        """Kind of its wire."""
        ...

    @property
    def contracts(self) -> tuple[ContractFile, ...]:
        """Required files, () if there are none."""
        ...

    def __call__(self, name: str, address: str, options: Any, wires: Wires, clock: Clock) -> Instrument:
        """Open the instrument's wire; sends nothing. `options` is an instance of `Options`."""
        ...
