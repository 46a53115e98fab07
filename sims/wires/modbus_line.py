"""Simulated Modbus wires: slaves that take their time, and a line to them inside the process."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

from sims.wires.modbus_slave import Registers, RtuSlave, TcpSlave
from sims.world import World

TURNAROUND_S = 0.010
"""Seconds a controller takes to answer [?]."""


class ModbusEndpoint:
    """One end of a wire with devices on it, answering after their turnaround.

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
    """A line to a simulated instrument under virtual time; what `drivers.wires.modbus` calls a transport.

    Args:
        world: virtual time.
        on_rx: the instrument's own, taking bytes and where to answer.

    """

    def __init__(self, world: World, on_rx: Callable[[bytes, Callable[[bytes], None]], None]) -> None:
        self._world = world
        self._on_rx = on_rx
        self._received = bytearray()

    def send(self, data: bytes) -> None:
        """Pass bytes to the instrument."""
        self._on_rx(data, self._received.extend)

    def recv(self, seconds: float) -> bytes:
        """What has come, waiting at most that many virtual seconds for the first byte; empty if none came."""
        received = self._received
        if not received:
            self._world.run_until(self._world.now() + seconds, lambda: bool(received))
        heard = bytes(received)
        received.clear()
        return heard

    def close(self) -> None:
        """Forget what has come and was not read."""
        self._received.clear()
