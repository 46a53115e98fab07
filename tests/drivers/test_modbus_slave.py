"""Our Modbus slave against pymodbus's server, byte for byte, and against the standard's own examples."""

import asyncio
import socket
import struct
import threading
from collections.abc import Iterator, Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymodbus.framer import FramerRTU
from pymodbus.server import ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice

from rig.sims.wires.modbus_slave import ILLEGAL_ADDRESS, Refused, RtuSlave, TcpSlave, crc16

FIRST, COUNT = 100, 200


class Block:
    """A plain block of registers."""

    identity = b"Pymodbus"

    def __init__(self) -> None:
        self.words = list(range(1000, 1000 + COUNT))

    def _inside(self, address: int, count: int) -> int:
        if not FIRST <= address <= address + count <= FIRST + COUNT:
            raise Refused(ILLEGAL_ADDRESS)
        return address - FIRST

    def read(self, address: int, count: int) -> Sequence[int]:
        at = self._inside(address, count)
        return self.words[at : at + count]

    def write(self, address: int, words: Sequence[int]) -> None:
        at = self._inside(address, len(words))
        self.words[at : at + len(words)] = words


@pytest.fixture(scope="module")
def pymodbus_port() -> Iterator[int]:
    started = threading.Event()
    state: dict[str, object] = {}

    async def serve() -> None:
        block = SimData(FIRST, values=list(range(1000, 1000 + COUNT)), datatype=DataType.REGISTERS)
        server = ModbusTcpServer(SimDevice(1, simdata=[block]), address=("127.0.0.1", 0))
        await server.serve_forever(background=True)
        state["server"], state["loop"] = server, asyncio.get_running_loop()
        state["port"] = server.transport.sockets[0].getsockname()[1]
        state["stop"] = asyncio.Event()
        started.set()
        await state["stop"].wait()
        await server.shutdown()

    thread = threading.Thread(target=lambda: asyncio.run(serve()), daemon=True)
    thread.start()
    assert started.wait(10)
    yield int(str(state["port"]))
    state["loop"].call_soon_threadsafe(state["stop"].set)  # type: ignore[attr-defined]  # an event loop
    thread.join(10)


def mbap(pdu: bytes, transaction: int = 7, unit: int = 1) -> bytes:
    return struct.pack(">HHHB", transaction, 0, 1 + len(pdu), unit) + pdu


REQUESTS = {
    "read one": struct.pack(">BHH", 3, 100, 1),
    "read many": struct.pack(">BHH", 3, 110, 125),
    "read the last": struct.pack(">BHH", 3, 299, 1),
    "read input registers": struct.pack(">BHH", 4, 120, 3),
    "write one": struct.pack(">BHH", 6, 130, 0xBEEF),
    "read it back": struct.pack(">BHH", 3, 129, 3),
    "write several": struct.pack(">BHHB3H", 16, 140, 3, 6, 1, 2, 65535),
    "read them back": struct.pack(">BHH", 3, 139, 5),
    "beyond the end": struct.pack(">BHH", 3, 299, 2),
    "before the beginning": struct.pack(">BHH", 3, 99, 2),
    "write beyond the end": struct.pack(">BHHB2H", 16, 299, 2, 4, 1, 2),
    "write one beyond the end": struct.pack(">BHH", 6, 300, 1),
    "write none": struct.pack(">BHHB", 16, 140, 0, 0),
    "wrong byte count": struct.pack(">BHHBH", 16, 140, 1, 4, 9),
    "echo": struct.pack(">BHH", 8, 0, 0xA537),
    "report identity": bytes((17,)),
    "write and read": struct.pack(">BHHHHB2H", 23, 149, 4, 150, 2, 4, 77, 78),
    "write and read what was written": struct.pack(">BHH", 3, 149, 4),
    "write and read beyond the end": struct.pack(">BHHHHBH", 23, 299, 2, 150, 1, 2, 5),
    "write beyond the end and read": struct.pack(">BHHHHBH", 23, 150, 1, 300, 1, 2, 5),
}


def test_answers_are_those_of_pymodbus_byte_for_byte(pymodbus_port: int) -> None:
    ours = TcpSlave({1: Block()})
    with socket.create_connection(("127.0.0.1", pymodbus_port), timeout=5) as theirs:
        for transaction, (what, pdu) in enumerate(REQUESTS.items(), start=1):
            request = mbap(pdu, transaction)
            theirs.sendall(request)
            assert ours.feed(request) == [theirs.recv(4096)], what


@pytest.mark.parametrize(
    ("request_pdu", "reply_pdu"),
    [
        # MODBUS Application Protocol 1.1b3, the standard's own examples of 6.3, 6.6, 6.12 and section 7
        ("03 006B 0003", "03 06 022B 0000 0064"),
        ("06 0001 0003", "06 0001 0003"),
        ("10 0001 0002 04 000A 0102", "10 0001 0002"),
        ("01 04A1 0001", "81 01"),
        ("03 006B 0000", "83 03"),
        ("03 006B 007E", "83 03"),
        ("03 FFFF 0002", "83 02"),
    ],
)
def test_the_standards_examples(request_pdu: str, reply_pdu: str) -> None:
    class Example:
        def read(self, address: int, count: int) -> Sequence[int]:
            if (address, count) != (0x6B, 3):
                raise Refused(ILLEGAL_ADDRESS)
            return [0x022B, 0, 0x64]

        def write(self, address: int, words: Sequence[int]) -> None:
            assert (address, list(words)) in ((1, [3]), (1, [0x0A, 0x0102]))

    request, reply = (bytes.fromhex(text) for text in (request_pdu, reply_pdu))
    assert TcpSlave({1: Example()}).feed(mbap(request)) == [mbap(reply)]
    frame, answer = b"\x01" + request, b"\x01" + reply
    assert RtuSlave({1: Example()}).feed(frame + crc16(frame)) == [answer + crc16(answer)]


@given(st.binary(max_size=260))
def test_check_sums_are_pymodbus_s(data: bytes) -> None:
    assert int.from_bytes(crc16(data), "big") == FramerRTU.compute_CRC(data)


@given(st.lists(st.sampled_from(sorted(REQUESTS)), max_size=6), st.lists(st.integers(1, 30), min_size=1), st.booleans())
def test_however_the_bytes_are_cut_the_answers_are_the_same(names: list[str], cuts: list[int], rtu: bool) -> None:
    frames = []
    for name in names:
        pdu = REQUESTS[name]
        if rtu and name == "wrong byte count":
            continue  # its length cannot be told on a line without silences
        frames.append(b"\x01" + pdu + crc16(b"\x01" + pdu) if rtu else mbap(pdu))
    whole, cut = (
        (RtuSlave({1: Block()}), RtuSlave({1: Block()})) if rtu else (TcpSlave({1: Block()}), TcpSlave({1: Block()}))
    )
    expected = [answer for frame in frames for answer in whole.feed(frame)]
    assert len(expected) == len(frames)
    stream, got, turn = b"".join(frames), [], 0
    while stream:
        size = cuts[turn % len(cuts)]
        got += cut.feed(stream[:size])
        stream, turn = stream[size:], turn + 1
    assert got == expected


def test_who_is_not_there_does_not_answer_on_a_line_and_the_gateway_answers_on_tcp() -> None:
    request = b"\x09" + REQUESTS["read one"]
    assert RtuSlave({1: Block()}).feed(request + crc16(request)) == []
    assert TcpSlave({1: Block()}).feed(mbap(REQUESTS["read one"], unit=9)) == [mbap(b"\x83\x0b", unit=9)]


def test_a_broadcast_is_carried_out_by_all_and_answered_by_none() -> None:
    one, two = Block(), Block()
    frame = b"\x00" + struct.pack(">BHH", 6, 100, 5)
    assert RtuSlave({1: one, 2: two}).feed(frame + crc16(frame)) == []
    assert one.words[0] == two.words[0] == 5


def test_a_frame_with_a_wrong_check_sum_is_ignored_and_the_next_one_heard() -> None:
    slave = RtuSlave({1: Block()})
    frame = b"\x01" + REQUESTS["read one"]
    assert slave.feed(frame + b"\x00\x00") == []
    assert len(slave.feed(frame + crc16(frame))) == 1


def test_what_is_not_modbus_is_dropped() -> None:
    slave = TcpSlave({1: Block()})
    assert slave.feed(b"GET / HTTP/1.1\r\n\r\n") == []
    assert len(slave.feed(mbap(REQUESTS["read one"]))) == 1
