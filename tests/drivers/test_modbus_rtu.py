"""Modbus RTU has no transaction number: late, doubled and trailing answers behind a serial server and on a line."""

from __future__ import annotations

import contextlib
import socket
import struct
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest
from pymodbus.framer.rtu import FramerRTU

from rig.drivers.clock import RealClock
from rig.drivers.errors import BadReply, NoReply
from rig.drivers.wires.modbus import ModbusLine, ModbusWires
from rig.drivers.wires.modbus_rtu import ends_with_answer, fits, framed, questions

SETPOINT, PROCESS_VALUE = 2782, 2820
WORDS = {SETPOINT: [60], PROCESS_VALUE: [23], **{16 + i: [i] for i in range(15)}}
Mangle = Callable[[Callable[[bytes], None], bytes, bytes], None]
"""What becomes of an answer: how to send, the request, the answer."""


def summed(body: bytes) -> bytes:
    return body + FramerRTU.compute_CRC(body).to_bytes(2, "big")


def answer(request: bytes, *, loopback: str) -> bytes:
    """A device of its own; `loopback` is "echo", "refused" or "ignored"."""
    unit, function, address, number = struct.unpack(">BBHH", request[:6])
    if function == 8:
        return {"echo": request, "refused": summed(bytes((unit, 0x88, 1))), "ignored": b""}[loopback]
    if function == 6:
        return request
    words = [WORDS.get(address + i, [0])[0] for i in range(number)]
    return summed(struct.pack(f">BBB{number}H", unit, function, 2 * number, *words))


@contextmanager
def behind_a_server(mangle: Mangle, loopback: str = "echo") -> Iterator[ModbusLine]:
    """A device behind a serial server on a real port; the server holds what it likes."""
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def serve() -> None:
            connection, _ = listener.accept()
            with connection:
                buffer = b""
                while data := connection.recv(4096):
                    buffer += data
                    while len(buffer) >= 8:
                        request, buffer = buffer[:8], buffer[8:]
                        mangle(connection.sendall, request, answer(request, loopback=loopback))

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        wires = ModbusWires(RealClock())
        line = wires.line(f"modbus-rtu://socket://127.0.0.1:{listener.getsockname()[1]}/1", "oven", timeout_s=0.5)
        line.known = (16, 15)
        yield line
        wires.close()
        thread.join(5)


def asks(request: bytes, address: int) -> bool:
    return request[1] == 3 and request[2:4] == address.to_bytes(2, "big")


@pytest.mark.parametrize("loopback", ["echo", "refused", "ignored"])
def test_an_answer_that_a_serial_server_holds_is_not_the_next_ones(loopback: str) -> None:
    """A setpoint of 60 was told as the process value, which was 23."""
    held, times = bytearray(), [0]

    def mangle(send: Callable[[bytes], None], request: bytes, reply: bytes) -> None:
        if asks(request, SETPOINT) and times[0] < 2:  # the question and its repetition
            times[0] += 1
            held.extend(reply)
        elif reply:
            send(bytes(held) + reply)
            held.clear()

    with behind_a_server(mangle, loopback) as line:
        for _ in range(2):
            with contextlib.suppress(NoReply):
                assert line.read(SETPOINT) == [60]
            assert line.read(PROCESS_VALUE) == [23]
        assert times == [2]


def test_a_doubled_answer_in_one_piece_is_refused_and_the_line_recovers() -> None:
    def mangle(send: Callable[[bytes], None], request: bytes, reply: bytes) -> None:
        send(reply + reply if asks(request, SETPOINT) else reply)

    with behind_a_server(mangle) as line:
        with pytest.raises(BadReply, match="not exactly one reply to the request"):
            line.read(SETPOINT)
        assert line.read(PROCESS_VALUE) == [23]


def test_a_doubled_answer_in_two_pieces_is_not_the_next_ones() -> None:
    read, sent = threading.Event(), threading.Event()

    def mangle(send: Callable[[bytes], None], request: bytes, reply: bytes) -> None:
        send(reply)
        if asks(request, SETPOINT):
            read.wait(5.0)
            send(reply)
            sent.set()

    with behind_a_server(mangle) as line:
        assert line.read(SETPOINT) == [60]
        read.set()
        assert sent.wait(5.0)
        with pytest.raises(BadReply, match="came after a reply, without a request"):
            line.read(PROCESS_VALUE)
        assert line.read(PROCESS_VALUE) == [23]


def test_bytes_after_an_answer_put_it_in_doubt() -> None:
    """An answer one behind all others fits every request; what shows it is that there is one more."""
    behind = [summed(bytes((1, 3, 2, 0, 60)))]
    read, sent = threading.Event(), threading.Event()

    def mangle(send: Callable[[bytes], None], request: bytes, reply: bytes) -> None:
        if asks(request, PROCESS_VALUE) and behind:
            send(behind.pop())
            read.wait(5.0)  # the packets of a server are some milliseconds apart
        send(reply)
        sent.set()

    with behind_a_server(mangle) as line:
        line.read(PROCESS_VALUE)  # 60, and nothing tells yet
        read.set()
        assert sent.wait(5.0)
        with pytest.raises(BadReply, match="came after a reply, without a request; that reply may be a late one"):
            line.read(SETPOINT)
        assert line.read(PROCESS_VALUE) == [23]


def test_an_answer_of_another_length_puts_the_line_out_of_step() -> None:
    late = [summed(bytes((1, 3, 4, 0, 1, 0, 2)))]
    asked: list[bytes] = []

    def mangle(send: Callable[[bytes], None], request: bytes, reply: bytes) -> None:
        asked.append(request)
        send(late.pop() if late else reply)

    with behind_a_server(mangle) as line:
        assert line.read(SETPOINT) == [60]
    assert [request[1] for request in asked] == [3, 8, 3], "the loopback stands between them"


def test_no_number_or_code_fits_a_question_that_brings_in_step() -> None:
    for number in range(40):
        for question in questions(1, number, (16, 15)):
            for words in (1, 2, 15):
                other = summed(bytes((1, 3, 2 * words)) + bytes(2 * words))
                assert not ends_with_answer(other, question)
            assert not ends_with_answer(summed(bytes((1, 0x83, 2))), question), "refused: any read may be"
            assert question == summed(question[:-2])
    one, two = (next(questions(1, number, (0, 0))) for number in (1, 2))
    assert ends_with_answer(b"\x01\x03late" + one, one)
    assert not ends_with_answer(one, two), "an older one"


def test_an_answer_is_whole_and_alone() -> None:
    read, reply = framed(1, bytes.fromhex("03 0ade 0001")), summed(bytes.fromhex("0103 02 003c"))
    assert fits(reply, read)
    wrong = (reply + b"\0", b"\0" + reply, reply[:-1], reply * 2, summed(bytes.fromhex("0203 02 003c")), b"")
    assert not any(fits(other, read) for other in wrong)
    write = framed(1, bytes.fromhex("10 0ade 0002 04 0000 41bc"))
    assert fits(summed(bytes.fromhex("01 10 0ade 0002")), write)
    assert not fits(summed(bytes.fromhex("01 10 0ade 0001")), write)


def test_a_device_that_confirms_another_value_is_told_apart_from_a_wrong_baud_rate() -> None:
    """A controller brings a setpoint to its limit, 9000, and says so in its answer."""

    def mangle(send: Callable[[bytes], None], request: bytes, reply: bytes) -> None:
        send(framed(request[0], request[1:4] + (9000).to_bytes(2, "big")) if request[1] == 6 else reply)

    with behind_a_server(mangle) as line, pytest.raises(BadReply, match="it confirms 9000 where 12000 was written"):
        line.write(SETPOINT, [12000])
