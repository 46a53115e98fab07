"""pymodbus's own server with an F4T's registers: a device whose meaning of numbers is nobody's of this project."""

from __future__ import annotations

import asyncio
import struct
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass

from pymodbus import FramerType
from pymodbus.client import ModbusTcpClient
from pymodbus.server import ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice


@dataclass(frozen=True)
class Foreign:
    """A server that runs.

    Attributes:
        port: on the loopback interface.
        framer: of TCP, or of a serial line behind a serial server.

    """

    port: int
    framer: FramerType

    @property
    def address(self) -> str:
        """As a bench file has it."""
        scheme = "modbus-tcp://" if self.framer is FramerType.SOCKET else "modbus-rtu://socket://"
        return f"{scheme}127.0.0.1:{self.port}/1"

    def words(self, address: int, count: int) -> list[int]:
        """What is in its registers, asked by pymodbus's own client."""
        with ModbusTcpClient("127.0.0.1", port=self.port, framer=self.framer, timeout=5) as client:
            return list(client.read_holding_registers(address, count=count).registers)

    def number(self, address: int) -> float:
        """A float in its registers, low word first."""
        low, high = self.words(address, 2)
        value: float = struct.unpack(">f", struct.pack(">HH", high, low))[0]
        return value

    def write(self, address: int, word: int) -> None:
        """Somebody else writes a register."""
        with ModbusTcpClient("127.0.0.1", port=self.port, framer=self.framer, timeout=5) as client:
            assert not client.write_register(address, word).isError()


@contextmanager
def serving(registers: Mapping[int, int | float], framer: FramerType) -> Iterator[Foreign]:
    """A server with these registers and no others: codes are one word each, floats two, the low one first."""
    blocks = []
    for address, value in registers.items():
        words = [value] if isinstance(value, int) else list(struct.unpack(">HH", struct.pack(">f", value)))[::-1]
        blocks.append(SimData(address, values=words, datatype=DataType.REGISTERS))
    started = threading.Event()
    found: dict[str, object] = {}

    async def serve() -> None:
        server = ModbusTcpServer(SimDevice(1, simdata=blocks), framer=framer, address=("127.0.0.1", 0))
        await server.serve_forever(background=True)
        assert server.transport is not None
        stop = asyncio.Event()
        found.update(loop=asyncio.get_running_loop(), stop=stop, port=server.transport.sockets[0].getsockname()[1])
        started.set()
        await stop.wait()
        await server.shutdown()

    thread = threading.Thread(target=lambda: asyncio.run(serve()), daemon=True)
    thread.start()
    assert started.wait(10)
    try:
        yield Foreign(int(str(found["port"])), framer)
    finally:
        found["loop"].call_soon_threadsafe(found["stop"].set)  # type: ignore[attr-defined]  # an event loop
        thread.join(10)
