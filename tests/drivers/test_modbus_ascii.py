"""Modbus ASCII: frames as a manual prints them, a wrong checksum, a torn line, addresses."""

from __future__ import annotations

import pytest

from rig.drivers.clock import RealClock
from rig.drivers.errors import BadReply, Unreachable, WrongAddress
from rig.drivers.wires.addresses import ModbusAddress
from rig.drivers.wires.modbus import ModbusLine, ModbusWires
from rig.drivers.wires.modbus_transport import AsciiTransport
from rig.drivers.wires.modbus_wire import ModbusWire

SERVER = ModbusAddress.parse("modbus-ascii://socket://127.0.0.1:9/1")
READ = b":010310000002EA\r\n"  # DTB4824 instruction sheet: process value and setpoint
ANSWER = b":01030400F100FA0D\r\n"


class Wire:
    """Characters to and from a device that answers by a list, in pieces."""

    def __init__(self, answers: dict[bytes, list[bytes]]) -> None:
        self.answers, self.sent, self.pending = answers, [], []

    def send(self, data: bytes) -> None:
        self.sent.append(data)
        # function 8 is not one of its functions
        self.pending = list(self.answers.get(data, [b":018801%02X\r\n" % (-0x8A & 0xFF)]))

    def recv(self, seconds: float) -> bytes:
        return self.pending.pop(0) if self.pending else b""

    def close(self) -> None:
        self.pending = []


def line(wire: Wire) -> ModbusLine:
    return ModbusLine(ModbusWire(SERVER, RealClock(), lambda: AsciiTransport(wire)), SERVER, "dtb", timeout_s=0.05)


def test_frames_are_those_of_the_manual_whatever_pieces_they_come_in() -> None:
    wire = Wire({READ: [ANSWER[:3], ANSWER[3:10], ANSWER[10:]], b":01050810FF00E3\r\n": [b":01050810FF00E3\r\n"]})
    dtb = line(wire)
    assert dtb.read(0x1000, 2) == [241, 250]
    dtb.write(0x0810, [1], table="coil")
    assert wire.sent == [READ, b":01050810FF00E3\r\n"]


@pytest.mark.parametrize(
    "answer",
    [b":01030400F200FA0D\r\n", b":01030400F100FA0D", b"01030400F100FA0D\r\n", ANSWER + ANSWER],
    ids=["wrong checksum", "torn", "no colon", "two"],
)
def test_what_is_not_one_whole_right_answer_is_refused(answer: bytes) -> None:
    with pytest.raises(BadReply):
        line(Wire({READ: [answer]})).read(0x1000, 2)


def test_an_address_says_that_it_is_ascii() -> None:
    serial = ModbusAddress.parse("modbus-ascii:///dev/ttyUSB0/1")
    assert (serial.kind, serial.frame, serial.ascii, SERVER.kind) == ("rtu", "7E1", True, "rtu-over-tcp")
    with pytest.raises(WrongAddress, match="7E1"):
        ModbusAddress.parse("modbus-ascii:///dev/ttyUSB0/1?frame=9N1")
    with pytest.raises(WrongAddress, match="8N1"):
        ModbusAddress.parse("modbus-rtu:///dev/ttyUSB0/1?frame=7E1")


def test_rtu_and_ascii_cannot_share_a_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rig.drivers.wires.modbus_wire.open_transport", lambda *_: Wire({}))
    wires = ModbusWires(RealClock())
    wires.line("modbus-ascii:///dev/ttyUSB0/1?frame=8N1")
    with pytest.raises(Unreachable, match="must agree"):
        wires.line("modbus-rtu:///dev/ttyUSB0/2?frame=8N1")


@pytest.mark.parametrize("table", ["coil", "discrete"])
def test_bits_are_read_on_a_serial_line(table: str) -> None:
    """Every answer with bits was taken for garbage on a line with RTU or ASCII frames."""
    question = b":010208140001E0\r\n" if table == "discrete" else b":010108140001E1\r\n"
    function = question[3:5]
    answer = b":01%s0101%02X\r\n" % (function, -(1 + int(function, 16) + 2) & 0xFF)
    assert line(Wire({question: [answer]})).read(0x0814, table=table) == [1]
