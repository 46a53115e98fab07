"""A simulated 34401A behind HiSLIP (IVI-6.1, revision 1.1): messages with an end, device clear on a second channel.

`python hislip_server.py` serves one client at a time and prints the port. A question SLOW? is answered late, if no
device clear comes before. The client that speaks to it in tests is pyvisa-py's.
"""

from __future__ import annotations

import socket
import struct
import sys
import threading
import time

from serial_bench import FakePlant

from rig.sims.twins.keysight_34401a import Keysight34401ATwin
from rig.sims.world import World

HEADER = struct.Struct("!2sBBIQ")
INITIALIZE, INITIALIZE_RESPONSE, DATA, DATA_END, CLEAR_COMPLETE, CLEAR_ACKNOWLEDGE = 0, 1, 6, 7, 8, 9
MAX_SIZE, MAX_SIZE_RESPONSE, ASYNC_INITIALIZE, ASYNC_INITIALIZE_RESPONSE = 15, 16, 17, 18
ASYNC_CLEAR, ASYNC_CLEAR_ACKNOWLEDGE = 19, 23
LATE_S = 0.6


class Instrument:
    """The meter, in virtual time that passes at once."""

    def __init__(self) -> None:
        self.world = World()
        self.twin = Keysight34401ATwin(
            "dvm", {"interface": "gpib"}, self.world, FakePlant(self.world, {"input": 2.5}), ""
        )

    def answer(self, message: bytes) -> bytes:
        found: list[bytes] = []
        self.twin.on_rx(message, found.append)
        self.world.sleep(5.0)
        return b"".join(found)


def read(connection: socket.socket) -> tuple[int, int, int, bytes]:
    def exactly(count: int) -> bytes:
        got = b""
        while len(got) < count:
            more = connection.recv(count - len(got))
            if not more:
                raise ConnectionError("the client has gone")
            got += more
        return got

    prologue, kind, control, parameter, length = HEADER.unpack(exactly(HEADER.size))
    assert prologue == b"HS"
    return kind, control, parameter, exactly(length)


def send(connection: socket.socket, kind: int, control: int, parameter: int, payload: bytes = b"") -> None:
    connection.sendall(HEADER.pack(b"HS", kind, control, parameter, len(payload)) + payload)


class Session:
    """One client, with its two channels."""

    def __init__(self, synchronous: socket.socket) -> None:
        self.synchronous = synchronous
        self.instrument = Instrument()
        self.cleared = threading.Event()

    def control(self, channel: socket.socket) -> None:
        while True:
            kind, _, _, _ = read(channel)
            if kind == MAX_SIZE:
                send(channel, MAX_SIZE_RESPONSE, 0, 0, struct.pack("!Q", 1 << 20))
            elif kind == ASYNC_CLEAR:
                self.cleared.set()
                self.instrument.twin.device_clear()
                send(channel, ASYNC_CLEAR_ACKNOWLEDGE, 0, 0)

    def messages(self) -> None:
        held = b""
        while True:
            kind, _, number, payload = read(self.synchronous)
            if kind == CLEAR_COMPLETE:
                held = b""
                send(self.synchronous, CLEAR_ACKNOWLEDGE, 0, 0)
                self.cleared.clear()
            elif kind in (DATA, DATA_END):
                held += payload
            if kind == DATA_END:
                self.carry_out(held, number)
                held = b""

    def carry_out(self, message: bytes, number: int) -> None:
        if b"SLOW?" in message:
            self.cleared.clear()
            threading.Thread(target=self.late, args=(number,), daemon=True).start()
        elif answer := self.instrument.answer(message):
            send(self.synchronous, DATA_END, 0, number, answer)

    def late(self, number: int) -> None:
        if not self.cleared.wait(LATE_S):
            send(self.synchronous, DATA_END, 0, 0xFFFFFFFF, b"too late\n")


def serve(listening: socket.socket) -> None:
    session: Session | None = None
    while True:
        connection, _ = listening.accept()
        kind, _, _, _ = read(connection)
        if kind == INITIALIZE:
            session = Session(connection)
            send(connection, INITIALIZE_RESPONSE, 0, (0x0100 << 16) | 1)
        elif kind == ASYNC_INITIALIZE and session is not None:
            send(connection, ASYNC_INITIALIZE_RESPONSE, 0, 0)
            for work in (lambda s=session, c=connection: s.control(c), session.messages):
                threading.Thread(target=quietly, args=(work,), daemon=True).start()


def quietly(work: object) -> None:
    try:
        work()  # type: ignore[operator]
    except (ConnectionError, OSError):
        return


if __name__ == "__main__":
    with socket.create_server(("127.0.0.1", 0)) as door:
        print(door.getsockname()[1], flush=True)
        threading.Thread(target=serve, args=(door,), daemon=True).start()
        time.sleep(60.0)  # noqa: TID251 - a process of its own, which ends by itself
        sys.exit(0)
