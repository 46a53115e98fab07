"""What a driver is: what the controller needs of its class, whoever wrote it.

A driver is found by its name in entry-point group `rig.drivers`. What it can do is one or more of the protocols of
`drivers.roles`; whatever else others have to know of it are attributes of its class.
"""

from __future__ import annotations

from typing import Any, Literal, NamedTuple, Protocol

from pydantic import BaseModel

from drivers.clock import Clock
from drivers.roles import Instrument
from drivers.wires import Wires

Medium = Literal["serial", "modbus", "can"]
"""What a wire carries; which addresses an instrument may have follows from it (`drivers.wires.addresses`)."""


class ContractFile(NamedTuple):
    """A text that both sides of a wire go by, such as an EDS, a DBC, a register map; driver and twin get the same one.

    Attributes:
        option: of driver and twin, that takes the text; a bench file may name a file of its own there.
        package: importable package that the file comes with.
        file: its name there.

    """

    option: str
    package: str
    file: str


class DriverClass(Protocol):
    """What an entry point of group `rig.drivers` names.

    Attributes:
        Options: what the bench file may say about the instrument; checks it.
        wire: what it talks over.
        contracts: files that it cannot do without, () if there are none.

    """

    Options: type[BaseModel]

    @property
    def wire(self) -> Medium:
        """See above."""
        ...

    @property
    def contracts(self) -> tuple[ContractFile, ...]:
        """See above."""
        ...

    def __call__(self, name: str, address: str, options: Any, wires: Wires, clock: Clock) -> Instrument:
        """Open the instrument's wire; sends nothing. `options` is an instance of `Options`."""
        ...
