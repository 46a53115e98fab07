"""What may go wrong with the messages on a simulated wire (`sims.faults.faulty_wire` makes it happen)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

Deliver = Callable[[bytes], None]


class Tampering(Protocol):
    """Stands between the host and an instrument; CAN frames come with their identifier in two bytes in front."""

    @property
    def unplugged(self) -> bool:
        """Whether there is no way to open the wire."""
        ...

    @property
    def off(self) -> bool:
        """Whether its CAN controller is bus-off."""
        ...

    @property
    def connection(self) -> int:
        """A number that changes when the connection is lost."""
        ...

    def to_twin(self, message: bytes, forward: Deliver, deliver: Deliver) -> None:
        """A message from the host; see `sims.faults.faulty_wire.FaultyWire`."""
        ...

    def to_host(self, message: bytes, deliver: Deliver) -> None:
        """A message from the instrument."""
        ...
