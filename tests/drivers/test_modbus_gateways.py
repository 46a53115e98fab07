"""Modbus gateways with habits of their own, on real sockets.

They close after each answer, give answers numbers of their own, echo requests, or swap the two words of a number.
"""

from __future__ import annotations

import contextlib
import os
import pty
import select
import socket
import struct
import threading
import tty
from collections.abc import Callable, Iterator

import pytest
from buses import REGISTER_MAP, oven
from test_modbus_line import Words

from rig.drivers.clock import RealClock
from rig.drivers.errors import BadReply, Unreachable
from rig.drivers.watlow_f4t import WatlowF4T
from rig.drivers.wires import Wires
from rig.drivers.wires.modbus import ModbusLine, ModbusWires, in_other_order, words_of_float
from rig.sims.wires.modbus_line import ModbusCable, ModbusEndpoint
from rig.sims.wires.modbus_slave import RtuSlave, TcpSlave

Answer = Callable[[bytes], bytes]
RESET = struct.pack("ii", 1, 0)
"""SO_LINGER: the connection ends with a reset."""


@contextlib.contextmanager
def gateway(answer: Answer, most: int, *, close: str = "") -> Iterator[tuple[str, list[int]]]:
    """A gateway that closes a connection after `most` requests; its address, and the requests on each connection.

    `close`: "reset"; or "late", a reset when the next request is there, which is lost.
    """
    requests: list[int] = []
    listener = socket.create_server(("127.0.0.1", 0))

    def serve() -> None:
        while True:
            try:
                connection, _ = listener.accept()
            except OSError:
                return
            requests.append(0)
            with connection, contextlib.suppress(OSError):
                while requests[-1] < most and (data := connection.recv(4096)):
                    requests[-1] += 1
                    connection.sendall(answer(data))
                if close == "late":
                    select.select([connection], [], [], 5.0)
                if close:
                    connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, RESET)

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    yield f"127.0.0.1:{listener.getsockname()[1]}", requests
    listener.shutdown(socket.SHUT_RDWR)
    listener.close()
    thread.join(5)


def line_to(place: str, *, rtu: bool = False, timeout_s: float = 0.2) -> ModbusLine:
    scheme = "modbus-rtu://socket" if rtu else "modbus-tcp"
    return ModbusWires(RealClock()).line(f"{scheme}://{place}/1", "oven", timeout_s=timeout_s)


@pytest.mark.parametrize("close", ["", "reset", "late"])
@pytest.mark.parametrize("rtu", [False, True])
def test_a_gateway_that_closes_after_each_answer_loses_no_reading_and_is_told_once(rtu: bool, close: str) -> None:
    registers = Words()

    def answer(data: bytes) -> bytes:
        return b"".join((RtuSlave if rtu else TcpSlave)({1: registers}).feed(data))

    with gateway(answer, 1, close=close) as (place, requests):
        line = line_to(place, rtu=rtu, timeout_s=5.0)
        assert line.read(3) == [0]
        assert line.remarks() == ()
        assert line.read(3) == [0]
        for number in range(10):
            line.write(4, [number, number])
            assert line.read(4, 2) == [number, number]
        line.close()
    assert registers.writes == [(4, [number, number]) for number in range(10)], "no write is lost or repeated"
    assert sum(requests) == line.exchanges - line.retries
    assert len(requests) <= 22 + 2, "one for each request, and at most two more in the beginning"
    assert line.remarks() == ("closes the connection after each answer; every request has a connection of its own",)


def test_a_connection_that_ends_after_several_answers_is_a_fault_since_the_device_may_have_been_restarted() -> None:
    with gateway(lambda data: b"".join(TcpSlave({1: Words()}).feed(data)), 3) as (place, _):
        line = line_to(place, timeout_s=5.0)
        for _ in range(3):
            line.read(3)
        with pytest.raises(Unreachable, match="was lost"):
            line.read(3)
        assert line.read(3) == [0]
        assert line.remarks() == ()
        line.close()


def test_a_gateway_that_never_answers_is_not_connected_to_again_and_again() -> None:
    with gateway(lambda _: b"", 1) as (place, requests):
        line = line_to(place)
        with pytest.raises(Unreachable, match="was lost"):
            line.read(3)
        line.close()
    assert len(requests) <= 2


@pytest.mark.parametrize("number", [0x0700, 7, 0])
def test_a_gateway_with_transaction_numbers_of_its_own_is_refused_by_name(number: int) -> None:
    def answer(data: bytes) -> bytes:
        return struct.pack(">H", number) + b"".join(TcpSlave({1: Words()}).feed(data))[2:]

    with gateway(answer, 9) as (place, _):
        line = line_to(place)
        with pytest.raises(
            BadReply, match=f"transaction number {number}, and the request had [12].*modbus-rtu://socket"
        ):
            line.read(3)
        line.close()


@pytest.mark.parametrize("answers", [True, False])
def test_an_echo_is_called_an_echo(answers: bool) -> None:
    ours, theirs = pty.openpty()
    tty.setraw(theirs)
    registers = Words()
    slave = RtuSlave({1: registers})

    def serve() -> None:
        with contextlib.suppress(OSError):
            while data := os.read(ours, 4096):
                os.write(ours, data + (b"".join(slave.feed(data)) if answers else b""))

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    line = ModbusWires(RealClock()).line(f"modbus-rtu://{os.ttyname(theirs)}/1", "oven", timeout_s=0.2)
    says = "an echo of the request itself, and " + ("then an answer" if answers else "no answer")
    with pytest.raises(BadReply, match=says):
        line.read(100, 2)
    with pytest.raises(BadReply, match=says):
        line.write(100, [1, 2])
    line.close()
    os.close(theirs)
    os.close(ours)
    thread.join(5)


@pytest.mark.parametrize("low_first", [True, False])
@pytest.mark.parametrize(("value", "swapped"), [(200.0, True), (-50.0, True), (23.0, True), (0.0, False)])
def test_a_number_that_is_none_suggests_the_other_word_order(value: float, swapped: bool, low_first: bool) -> None:
    words = words_of_float(value, low_first=not low_first)
    assert in_other_order(words, low_first=low_first) == (value if swapped else None)
    assert in_other_order(words, low_first=not low_first) is None


def test_a_chamber_with_swapped_words_is_named_and_never_set() -> None:
    bench = oven()
    before = bench.plant.chamber("oven").setpoint_degC
    high_first = REGISTER_MAP.replace('"low-first"', '"high-first"')
    assert high_first != REGISTER_MAP
    endpoint = ModbusEndpoint(bench.world, {1: bench.twin.ports["tcp"]})
    wires = Wires(bench.world, simulated={"modbus": lambda _: ModbusCable(bench.world, endpoint.on_rx)})
    driver = WatlowF4T("oven", "sim://w/oven", WatlowF4T.Options(register_map=high_first), wires, bench.world)
    for work in (driver.prepare, lambda: driver.set_temperature(25.0), driver.read):
        with pytest.raises(BadReply, match=r"with its two words in the other order; .* set it to high word first"):
            work()
    assert bench.plant.chamber("oven").setpoint_degC == before
