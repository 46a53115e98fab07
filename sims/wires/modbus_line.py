"""Simulated Modbus wires: slaves with a response time, and a line to them inside the process."""

from __future__ import annotations

import errno
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from rig.sims.wires.modbus_slave import Registers, RtuSlave, TcpSlave
from rig.sims.wires.tampering import UNTOUCHED, Tampering
from rig.sims.world import World

TURNAROUND_S = 0.010
"""Response time of a controller, seconds [?]."""


def registers_of(twin: Any, address: str) -> Registers:
    """A twin's registers at an address of the bench file: those of a port if its ports differ."""
    ports = getattr(twin, "ports", None)
    registers: Registers = ports["rtu" if address.startswith("modbus-rtu:") else "tcp"] if ports else twin.registers
    return registers


class ModbusEndpoint:
    """One end of a wire with devices on it, answering after their response time.

    Args:
        world: virtual time.
        devices: registers by unit.
        rtu: framed for a serial line instead of TCP.
    """

    def __init__(self, world: World, devices: Mapping[int, Registers], *, rtu: bool = False) -> None:
        self._world = world
        self._slave = RtuSlave(devices) if rtu else TcpSlave(devices)

    def on_rx(self, data: bytes, tx: Callable[[bytes], None]) -> None:
        """Take bytes from the master; answers go to `tx` later."""
        for reply in self._slave.feed(data):
            self._world.call_in(TURNAROUND_S, partial(tx, reply))


class ModbusCable:
    """A line to a simulated instrument under virtual time; a transport of `rig.drivers.wires.modbus`.

    Args:
        world: virtual time.
        on_rx: the instrument's function; takes bytes and a function for answers.
        tampering: faults of the line.

    Raises:
        OSError: the instrument cannot be reached.
    """

    def __init__(
        self,
        world: World,
        on_rx: Callable[[bytes, Callable[[bytes], None]], None],
        tampering: Tampering = UNTOUCHED,
    ) -> None:
        self._world = world
        self._on_rx = on_rx
        self._received = bytearray()
        self._tampering = tampering
        if tampering.unplugged:
            raise OSError(errno.EHOSTUNREACH, "No route to host")
        self._connection = tampering.connection
        self._answer = partial(tampering.to_host, deliver=self._received.extend)

    def send(self, data: bytes) -> None:
        """Pass bytes to the instrument. Raises `ConnectionResetError` if the connection was lost."""
        self._check()
        self._tampering.to_twin(data, self._forward, self._received.extend)

    def recv(self, seconds: float) -> bytes:
        """Received bytes, waiting at most this many virtual seconds for the first; empty if none came.

        Raises `ConnectionResetError` if the connection was lost.
        """
        received = self._received
        if not received:
            tampering, here = self._tampering, self._connection
            self._world.run_until(self._world.now() + seconds, lambda: received or tampering.connection != here)
        self._check()
        heard = bytes(received)
        received.clear()
        return heard

    def close(self) -> None:
        """Discard received bytes."""
        self._received.clear()

    def _forward(self, data: bytes) -> None:
        self._on_rx(data, self._answer)

    def _check(self) -> None:
        if self._tampering.connection != self._connection:
            raise ConnectionResetError(errno.ECONNRESET, "Connection reset by peer")
