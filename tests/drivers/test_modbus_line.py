"""The Modbus master: against pymodbus's server, and against wires that are late, garbled, busy or gone."""

import os
import pty
import socket
import threading
import tty
from collections.abc import Callable, Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymodbus.client import ModbusTcpClient

from rig.drivers.clock import RealClock
from rig.drivers.errors import BadReply, InstrumentError, NoReply, Unreachable
from rig.drivers.wires.addresses import ModbusAddress
from rig.drivers.wires.modbus import ModbusLine, ModbusWires, float_of_words, words_of_float
from rig.sims.wires.modbus_line import ModbusCable, ModbusEndpoint
from rig.sims.wires.modbus_slave import RtuSlave, TcpSlave
from rig.sims.world import World


class Words:
    """Registers that remember what was asked of them."""

    def __init__(self) -> None:
        self.at = dict.fromkeys(range(200), 0)
        self.writes: list[tuple[int, list[int]]] = []

    def read(self, address: int, count: int) -> list[int]:
        return [self.at[address + i] for i in range(count)]

    def write(self, address: int, words: list[int]) -> None:
        self.writes.append((address, list(words)))
        self.at.update({address + i: word for i, word in enumerate(words)})


Hear = Callable[[bytes, Callable[[bytes], None]], None]


def simulated(
    hear: Callable[[World], Hear], **options: float
) -> tuple[World, ModbusLine, list[tuple[str, str, bytes]]]:
    world = World()
    log: list[tuple[str, str, bytes]] = []
    wires = ModbusWires(world, lambda address: ModbusCable(world, hear(world)), lambda *transfer: log.append(transfer))
    return world, wires.line("sim://w/oven", "oven", **options), log


def test_a_read_and_a_write_are_the_standards_bytes() -> None:
    registers = Words()
    registers.at[107] = 0x022B
    _, line, log = simulated(lambda world: ModbusEndpoint(world, {1: registers}).on_rx)
    assert line.read(107, 3) == [0x022B, 0, 0]
    line.write(1, [10, 258])
    line.write(7, [3])
    assert [(name, way, data.hex()) for name, way, data in log] == [
        ("oven", "tx", "0001000000060103006b0003"),
        ("oven", "rx", "000100000009010306022b00000000"),
        ("oven", "tx", "00020000000b01100001000204000a0102"),
        ("oven", "rx", "000200000006011000010002"),
        ("oven", "tx", "000300000006010600070003"),
        ("oven", "rx", "000300000006010600070003"),
    ]
    assert registers.writes == [(1, [10, 258]), (7, [3])]
    assert (line.exchanges, line.retries) == (3, 0)


def test_waiting_costs_virtual_time_only() -> None:
    world, line, _ = simulated(lambda world: ModbusEndpoint(world, {1: Words()}).on_rx)
    line.read(0)
    assert world.now() == pytest.approx(0.010)


def test_a_read_without_reply_is_repeated_once_and_then_reported() -> None:
    heard: list[bytes] = []
    world, line, _ = simulated(lambda world: lambda data, tx: heard.append(data), timeout_s=2.0)
    with pytest.raises(NoReply, match=r"oven at sim://w/oven did not answer within 2 s; is it switched on"):
        line.read(0)
    assert len(heard) == 2
    assert (line.exchanges, line.retries) == (2, 1)
    assert 4.0 <= world.now() < 5.0


def test_a_write_without_reply_is_never_repeated() -> None:
    heard: list[bytes] = []
    _, line, _ = simulated(lambda world: lambda data, tx: heard.append(data))
    with pytest.raises(NoReply):
        line.write(0, [1])
    assert len(heard) == 1


def test_many_silences_do_not_wear_the_line_out() -> None:
    answering = [False]

    def hear(world: World) -> Hear:
        endpoint = ModbusEndpoint(world, {1: Words()})
        return lambda data, tx: endpoint.on_rx(data, tx) if answering[0] else None

    _, line, _ = simulated(hear)
    for _ in range(10):
        with pytest.raises(NoReply):
            line.write(0, [1])
    answering[0] = True
    assert line.read(0) == [0]


@pytest.mark.parametrize("late_s", [1.1, 1.25, 1.45])
def test_a_late_reply_does_not_answer_the_next_request(late_s: float) -> None:
    delays = iter([late_s])

    def hear(world: World) -> Hear:
        slave = TcpSlave({1: registers})

        def on_rx(data: bytes, tx: Callable[[bytes], None]) -> None:
            (reply,) = slave.feed(data)
            world.call_in(next(delays, 0.01), lambda: tx(reply))

        return on_rx

    registers = Words()
    registers.at.update({5: 55, 6: 66})
    _, line, _ = simulated(hear)
    with pytest.raises(NoReply):
        line.write(5, [55])
    assert line.read(6) == [66]
    assert line.read(5) == [55]


def test_garbage_is_a_bad_reply_and_the_line_recovers() -> None:
    first = [True]

    def hear(world: World) -> Hear:
        endpoint = ModbusEndpoint(world, {1: Words()})

        def on_rx(data: bytes, tx: Callable[[bytes], None]) -> None:
            if first.pop() if first else False:
                tx(b"\x00\x01\x00\x00\x00")
            else:
                endpoint.on_rx(data, tx)

        return on_rx

    _, line, _ = simulated(hear)
    with pytest.raises(BadReply, match="which is not exactly one reply to the request"):
        line.write(0, [1])
    assert line.read(0) == [0]


def refusing(*codes: int) -> tuple[ModbusLine, list[bytes], World]:
    heard: list[bytes] = []
    left = list(codes)

    def hear(world: World) -> Hear:
        endpoint = ModbusEndpoint(world, {1: Words()})

        def on_rx(data: bytes, tx: Callable[[bytes], None]) -> None:
            heard.append(data)
            if left:
                tx(data[:4] + b"\x00\x03" + data[6:7] + bytes((data[7] | 0x80, left.pop(0))))
            else:
                endpoint.on_rx(data, tx)

        return on_rx

    world, line, _ = simulated(hear)
    return line, heard, world


@pytest.mark.parametrize(("code", "words"), [(1, "function"), (2, "no such register"), (3, "value"), (11, "gateway")])
def test_an_exception_is_the_instruments_own_error(code: int, words: str) -> None:
    line, heard, _ = refusing(code)
    with pytest.raises(InstrumentError, match=f"reports error {code}: reading 2 word.s. at 9: .*{words}") as caught:
        line.read(9, 2)
    assert caught.value.code == code
    assert len(heard) == 1


def test_a_busy_device_is_asked_again_also_for_a_write_since_it_did_nothing() -> None:
    line, heard, world = refusing(6, 6)
    line.write(3, [4])
    assert len(heard) == 3
    assert line.retries == 2
    assert world.now() >= 0.4


def test_a_confirmation_of_something_else_is_a_bad_reply() -> None:
    def hear(world: World) -> Hear:
        return lambda data, tx: tx(data[:-1] + b"\x63")

    _, line, _ = simulated(hear)
    with pytest.raises(BadReply, match="confirms something else"):
        line.write(3, [4])


@given(st.floats(width=32, allow_nan=False), st.booleans())
def test_floats_are_pymodbus_s(value: float, low_first: bool) -> None:
    order = "little" if low_first else "big"
    words = words_of_float(value, low_first=low_first)
    assert words == ModbusTcpClient.convert_to_registers(value, ModbusTcpClient.DATATYPE.FLOAT32, word_order=order)
    assert float_of_words(words, low_first=low_first) == value


def test_the_low_word_comes_first() -> None:
    assert words_of_float(1.0) == [0x0000, 0x3F80]


@pytest.mark.parametrize(
    ("text", "parsed"),
    [
        ("modbus-tcp://192.0.2.10:502/1", ModbusAddress("tcp", "192.0.2.10:502", 1)),
        ("modbus-tcp://oven.lab/17", ModbusAddress("tcp", "oven.lab:502", 17)),
        ("modbus-rtu:///dev/ttyUSB1/2", ModbusAddress("rtu", "/dev/ttyUSB1", 2)),
        ("modbus-rtu:///dev/serial/x/2?baud=38400&frame=8E1", ModbusAddress("rtu", "/dev/serial/x", 2, 38400, "8E1")),
        ("modbus-rtu:///COM4/1", ModbusAddress("rtu", "COM4", 1)),
        ("modbus-rtu://socket://serial-server:4001/3", ModbusAddress("rtu-over-tcp", "serial-server:4001", 3)),
        ("sim://w/oven", ModbusAddress("sim", "sim://w/oven", 1)),
        ("modbus-rtu://sim://w/oven/1", ModbusAddress("sim-rtu", "sim://w/oven", 1)),
    ],
)  # fmt: skip
def test_addresses(text: str, parsed: ModbusAddress) -> None:
    assert ModbusAddress.parse(text) == parsed


@pytest.mark.parametrize(
    "text",
    ["modbus-tcp://host", "modbus-tcp://host:x/1", "modbus-tcp:///1", "modbus-rtu:///dev/ttyUSB1/0", "tcp://host/1",
     "modbus-rtu:///dev/ttyUSB1/1?parity=E", "modbus-rtu:///dev/ttyUSB1/1?frame=7E2", "modbus-tcp://host/300", ""],
)  # fmt: skip
def test_what_is_no_address_says_what_one_looks_like(text: str) -> None:
    with pytest.raises(Unreachable, match="is not a Modbus address; write modbus-tcp://HOST:502/UNIT or"):
        ModbusAddress.parse(text)


def test_a_closed_port_is_unreachable() -> None:
    with socket.socket() as unused:
        unused.bind(("127.0.0.1", 0))
        port = unused.getsockname()[1]
        with pytest.raises(Unreachable, match=rf"127.0.0.1:{port} cannot be opened .*refused"):
            ModbusWires(RealClock()).line(f"modbus-tcp://127.0.0.1:{port}/1", "oven")


@pytest.fixture
def tcp_device() -> Iterator[tuple[int, Words, list[socket.socket]]]:
    """A device on a real TCP port, answering in a thread."""
    registers, open_sockets = Words(), []
    listener = socket.create_server(("127.0.0.1", 0))

    def serve() -> None:
        while True:
            try:
                connection, _ = listener.accept()
            except OSError:
                return
            open_sockets.append(connection)
            slave = TcpSlave({1: registers, 2: Words()})
            try:
                while data := connection.recv(4096):
                    for reply in slave.feed(data):
                        connection.sendall(reply)
            except OSError:
                pass
            connection.close()

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    yield listener.getsockname()[1], registers, open_sockets
    for one in open_sockets:
        one.close()
    listener.shutdown(socket.SHUT_RDWR)
    listener.close()
    thread.join(5)


def test_over_tcp_devices_share_one_connection_which_reopens(
    tcp_device: tuple[int, Words, list[socket.socket]],
) -> None:
    port, registers, connections = tcp_device
    wires = ModbusWires(RealClock())
    one = wires.line(f"modbus-tcp://127.0.0.1:{port}/1", "oven")
    two = wires.line(f"modbus-tcp://127.0.0.1:{port}/2", "fridge")
    one.write(4, [1, 2])
    assert one.read(4, 2) == [1, 2]
    assert two.read(4, 2) == [0, 0]
    assert len(connections) == 1
    connections[0].shutdown(socket.SHUT_RDWR)
    with pytest.raises(Unreachable, match=r"oven at .* was lost"):
        one.read(4)
    assert one.read(4, 2) == [1, 2]
    assert registers.writes == [(4, [1, 2])]
    wires.close()
    wires.close()


def test_behind_a_serial_server_frames_are_rtu_and_may_come_in_pieces() -> None:
    registers, heard = Words(), bytearray()
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def serve() -> None:
            connection, _ = listener.accept()
            slave = RtuSlave({1: registers})
            with connection:
                connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                while data := connection.recv(4096):
                    heard.extend(data)
                    for reply in slave.feed(data):
                        for byte in reply:  # a packet each
                            connection.sendall(bytes((byte,)))

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        wires = ModbusWires(RealClock())
        place = f"modbus-rtu://socket://127.0.0.1:{listener.getsockname()[1]}"
        line = wires.line(f"{place}/1", "oven", timeout_s=5.0)
        line.write(4, words_of_float(23.5))
        assert float_of_words(line.read(4, 2)) == 23.5
        assert heard[:13].hex() == "01100004000204000041bc" + heard[11:13].hex()
        silent = wires.line(f"{place}/2", "fridge", timeout_s=0.05)
        with pytest.raises(NoReply, match="fridge at modbus-rtu://socket://"):
            silent.read(4)
        assert float_of_words(line.read(4, 2)) == 23.5
        wires.close()
        thread.join(5)


@pytest.fixture
def rtu_device() -> Iterator[tuple[str, Words]]:
    """A device on a pseudo-terminal, answering in a thread."""
    ours, theirs = pty.openpty()
    tty.setraw(theirs)
    registers = Words()
    slave = RtuSlave({1: registers})

    def serve() -> None:
        while True:
            try:
                data = os.read(ours, 4096)
            except OSError:
                return
            if b"stop" in data:
                return
            for reply in slave.feed(data):
                os.write(ours, reply)

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    yield os.ttyname(theirs), registers
    os.write(theirs, b"stop")
    thread.join(5)
    os.close(ours)
    os.close(theirs)


def test_over_a_serial_line_frames_are_rtu_and_nobody_polls(rtu_device: tuple[str, Words]) -> None:
    device, _ = rtu_device
    wires, log = ModbusWires(RealClock(), tap=lambda *transfer: log.append(transfer)), []
    line = wires.line(f"modbus-rtu://{device}/1?baud=115200", "oven", timeout_s=2.0)
    line.write(4, words_of_float(23.5))
    assert float_of_words(line.read(4, 2)) == 23.5
    assert log[0] == ("oven", "tx", bytes.fromhex("0110000400020400 0041bc") + log[0][2][-2:])
    clock, took = RealClock(), []
    for _ in range(50):
        began = clock.now()
        line.read(4, 2)
        took.append(clock.now() - began)
    assert min(took) < 0.0175 / 2, "an exchange costs the silence and little more, on a machine that is busy too"
    wires.close()
    with pytest.raises(Unreachable, match="already runs at 115200 baud 8N1"):
        wires.line(f"modbus-rtu://{device}/2?baud=9600", "fridge")


def test_nobody_answers_for_another_unit_on_a_serial_line(rtu_device: tuple[str, Words]) -> None:
    device, _ = rtu_device
    line = ModbusWires(RealClock()).line(f"modbus-rtu://{device}/5?baud=115200", "fridge", timeout_s=0.05)
    with pytest.raises(NoReply, match="fridge at modbus-rtu"):
        line.write(1, [2])
    line.close()
