"""The instrument's end of a serial cable, under virtual time.

A cable takes the time of its baud rate in both directions. Bytes from the host arrive at the twin when their last
character has passed. The twin's answers go to the host's end of the cable: a pyserial client on a `sim://` address in
this process, or a pseudo-terminal that another process has open.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Protocol, runtime_checkable

import serial

from rig.sims.wires.tampering import UNTOUCHED, Tampering
from rig.sims.world import World

_HANDLERS = "rig.sims.wires.serial_handlers"


class SerialEnd(Protocol):
    """Requirements of a cable on its twin."""

    baud: int
    frame: str

    def on_rx(self, data: bytes, tx: Callable[[bytes], None]) -> None:
        """Take bytes; answer through `tx`, now or later."""
        ...


@runtime_checkable
class Handshaking(Protocol):
    """A twin that reads the line DSR, which is the host's DTR: None without a host."""

    dsr: bool | None


@runtime_checkable
class Talking(Protocol):
    """A twin that may talk by itself."""

    def connected(self, tx: Callable[[bytes], None]) -> None:
        """A host is there, which hears what goes to `tx`."""
        ...


def bits_per_character(frame: str) -> int:
    """Start bit, data bits, parity bit if any, stop bits: "8N1" is 10, "7E2" is 11."""
    return 1 + int(frame[0]) + (frame[1] != "N") + int(frame[2])


class SerialCable:
    """A cable with a twin at its end.

    Args:
        world: virtual time.
        twin: the instrument.
        tampering: faults of the cable.
        timed: whether it has a baud rate and a frame, equal at both ends; a network socket has neither.

    Attributes:
        setting: baud rate and frame; None if it has none.
        tampering: faults of the cable. Its `connection` changes when the host's port disappears: an earlier opened
            port is then dead.
    """

    def __init__(self, world: World, twin: SerialEnd, tampering: Tampering = UNTOUCHED, *, timed: bool = True) -> None:
        self.world = world
        self.tampering = tampering
        self.setting = (twin.baud, twin.frame) if timed else None
        self._twin = twin
        self._character_s = bits_per_character(twin.frame) / twin.baud if timed else 0.0
        self._to_twin_free = 0.0
        self._to_host_free = 0.0
        self._receive: Callable[[bytes], None] | None = None
        # bound once, for all exchanges of a night
        self._forth, self._back = self._carry_out, self._carry_back
        self._answer = partial(tampering.to_host, deliver=self._back)

    @property
    def attached(self) -> bool:
        """Whether the host's end is connected."""
        return self._receive is not None

    def hears(self, receive: Callable[[bytes], None]) -> bool:
        """Whether this is the host's end that is connected."""
        return self._receive == receive

    def attach(self, receive: Callable[[bytes], None] | None) -> None:
        """Connect the host's end to `receive`; None disconnects it, and arriving bytes are lost."""
        self._receive = receive
        if receive is not None and isinstance(self._twin, Talking):
            self._twin.connected(self._answer)

    def send(self, data: bytes) -> None:
        """Take bytes from the host; they arrive at the twin after their time on the line."""
        self.tampering.to_twin(data, self._forth, self._back)

    def host_dtr(self, on: bool | None) -> None:
        """The host sets its line DTR; None without a host. TCP has no such line."""
        if self.setting is not None and isinstance(self._twin, Handshaking):
            self._twin.dsr = on

    def _carry_out(self, data: bytes) -> None:
        world = self.world
        now, free = world.now(), self._to_twin_free
        self._to_twin_free = free = (free if free > now else now) + len(data) * self._character_s
        world.call_in(free - now, partial(self._twin.on_rx, data, self._answer))

    def _carry_back(self, data: bytes) -> None:
        world = self.world
        now, free = world.now(), self._to_host_free
        self._to_host_free = free = (free if free > now else now) + len(data) * self._character_s
        world.call_in(free - now, partial(self._arrive, data))

    def _arrive(self, data: bytes) -> None:
        if self._receive is not None:
            self._receive(data)


_cables: dict[str, SerialCable] = {}


def register(place: str, cable: SerialCable) -> None:
    """Make a cable reachable as `sim://PLACE` for every pyserial client in this process."""
    if _HANDLERS not in serial.protocol_handler_packages:
        serial.protocol_handler_packages.append(_HANDLERS)
    _cables[place] = cable


def unregister(place: str) -> None:
    """Remove an address; harmless if it does not exist."""
    _cables.pop(place, None)


def find(place: str) -> SerialCable | None:
    """The cable at `sim://PLACE`."""
    return _cables.get(place)
