"""Possible faults of messages on a simulated wire (`rig.sims.faults.faulty_wire` executes them)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

Deliver = Callable[[bytes], None]


class Tampering(Protocol):
    """Sits between the host and an instrument; CAN frames are preceded by their identifier in two bytes."""

    @property
    def unplugged(self) -> bool:
        """Whether the wire cannot be opened."""
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
        """A message from the host; see `rig.sims.faults.faulty_wire.FaultyWire`."""
        ...

    def to_host(self, message: bytes, deliver: Deliver) -> None:
        """A message from the instrument."""
        ...


class Untouched:
    """A wire without faults."""

    unplugged = off = False
    connection = 0

    def to_twin(self, message: bytes, forward: Deliver, deliver: Deliver) -> None:
        """A message from the host; see `rig.sims.faults.faulty_wire.FaultyWire`."""
        forward(message)

    def to_host(self, message: bytes, deliver: Deliver) -> None:
        """A message from the instrument."""
        deliver(message)


UNTOUCHED = Untouched()
