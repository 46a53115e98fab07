"""Frames of lines with checksums: their kinds, over which part, as digits or bytes, before or after an end."""

from __future__ import annotations

import socketserver
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import reduce

import pytest
from command import rig
from declared_bench import DeclaredBench
from fake_lines import answering

from rig.bench.plugins import driver_class
from rig.contracts.declared.instrument import parse
from rig.contracts.declared.sums import NAMED, Checksum, Frame
from rig.drivers.errors import BadReply, InstrumentError, NoReply, WrongInstrument
from rig.errors import ConfigurationError

SOURCE = r"""
model = "N1"
maker = "ACME"
parameters = { node = 3 }
[wire]
WIRE
[identity]
ask = "ID"
answer = "{model}"
[source]
unit = "V"
low = 0
high = 100
set = { tell = "SP{value:.3}", answer = "OK" }
setpoint = { ask = "SP?", answer = "SP{value:.3}" }
read = { ask = "PV?", answer = "PV {value:8.3}" }
safe_value = 0
tolerance = 0.1
dwell_s = 1
"""
BISYNCH = r"""send_end = ""
request = "\u0002{node:02}{line}\u0003{checksum}"
reply = "\u0002{line}\u0003{checksum}"
checksum = { kind = "xor", over = "{line}\u0003", as = "binary" }"""
NMEA = r"""send_end = "\r\n"
request = "${line}*{checksum}"
reply = "${line}*{checksum}"
checksum = { kind = "xor", over = "{line}" }"""
MODBUS_LIKE = r"""send_end = ""
request = "<{line}>{checksum}"
reply = "<{line}>{checksum}"
checksum = { kind = "crc16 modbus", as = "binary, low byte first" }"""
BEFORE_THE_END = r"""send_end = "\r"
request = "{node:02}:{line};{checksum}"
reply = "{node:02}:{line};{checksum}"
checksum = { kind = "crc16 ccitt", as = "lower hex" }"""
BYTES_BEFORE_THE_END = r"""send_end = "\r\n"
request = "{line}{checksum}"
reply = "{line}{checksum}"
checksum = { kind = "crc16 xmodem", as = "binary" }"""
DECIMAL = r"""send_end = "\n"
request = "{checksum} {line}"
reply = "{checksum} {line}"
checksum = { kind = "sum", width = 16, over = "{line}", as = "decimal" }"""
THREE_DIGITS = r"""send_end = "\r"
request = "{node:03}{line}{checksum:03}"
reply = "{node:03}{line}{checksum:03}"
checksum = { kind = "sum", as = "decimal" }"""
OWN_POLYNOMIAL = r"""send_end = "\r"
request = "{line} {checksum}"
reply = "{line} {checksum}"
checksum = { kind = "crc", polynomial = 0x1D, init = 0xFF, xorout = 0xFF }"""
NO_SUM = r"""send_end = ""
request = "({line})"
reply = "({line})" """
EVERY = (
    BISYNCH,
    NMEA,
    MODBUS_LIKE,
    BEFORE_THE_END,
    BYTES_BEFORE_THE_END,
    DECIMAL,
    THREE_DIGITS,
    OWN_POLYNOMIAL,
    NO_SUM,
)


def bench(wire: str, more: str = "") -> DeclaredBench:
    return DeclaredBench(SOURCE.replace("WIRE", wire), more=more)


@pytest.mark.parametrize(
    ("kind", "right"),
    [
        ("crc8", 0xF4),
        ("crc8 maxim", 0xA1),
        ("crc16 modbus", 0x4B37),
        ("crc16 arc", 0xBB3D),
        ("crc16 ccitt", 0x29B1),
        ("crc16 xmodem", 0x31C3),
        ("crc32", 0xCBF43926),
        ("sum", sum(b"123456789") & 0xFF),
        ("negative sum", -sum(b"123456789") & 0xFF),
        ("xor", 0x31),
    ],
)
def test_kinds_by_the_check_values_of_catalogues(kind, right):
    """Those of the catalogue of parametrised CRC algorithms (G. Cook): the result for 123456789."""
    assert Checksum(kind=kind).of(b"123456789") == right


def test_a_file_of_before_that_says_that_it_has_no_checksum_is_read():
    assert parse(SOURCE.replace("WIRE", 'checksum = ""')).wire.checksum is None


def test_a_crc_by_its_parameters_is_the_named_one():
    for name, (width, polynomial, init, reflect, xorout) in NAMED.items():
        own = Checksum(kind="crc", width=width, polynomial=polynomial, init=init, reflect=reflect, xorout=xorout)
        assert own.of(b"any text") == Checksum(kind=name).of(b"any text")
    sae_j1850 = Checksum(kind="crc", polynomial=0x1D, init=0xFF, xorout=0xFF)
    assert sae_j1850.of(b"123456789") == 0x4B
    assert Checksum(kind="sum", width=16).of(b"\xff" * 300) == 0xFF * 300 & 0xFFFF


@pytest.mark.parametrize("wire", EVERY)
def test_a_source_is_set_and_read_through_its_frame(wire):
    it = bench(wire, more="" if wire in (NMEA, MODBUS_LIKE) else "node = 7")
    try:
        assert it.it.identify().model == "N1"
        it.it.prepare()
        for aim in range(1, 60):  # so that some checksum looks like an end, or like XON
            it.it.set(aim + 0.125)
            assert it.it.read().setpoint == aim + 0.125
        it.it.make_safe()
        assert it.it.read().safe
    finally:
        it.close()


@pytest.mark.parametrize("wire", EVERY[:-1])
def test_a_damaged_answer_is_refused_and_the_next_one_is_not(wire):
    it = bench(wire)
    try:
        it.it.identify()
        right = it.twin._framed
        wrong = [3]

        def framed(line: str) -> str:
            wrong[0] -= 1
            return right(line) if wrong[0] < 0 else right(line.replace("SP", "SQ")).replace("SQ", "SP")

        it.twin._framed = framed
        with pytest.raises((BadReply, NoReply), match=r"checksum"):
            it.it._talk.number(it.it.table.source.setpoint)
        wrong[0] = 0
        it.it.set(12.5)
        assert it.it.read().setpoint == 12.5
    finally:
        it.close()


def test_the_bytes_are_those_of_the_manual():
    """ANSI X3.28 (Eurotherm's bisynch): exclusive or of all after STX up to ETX; NMEA 0183: of all between $ and *."""
    bisynch = Frame("\x02{line}\x03{checksum}", Checksum(kind="xor", over="{line}\x03", **{"as": "binary"}), {})
    assert bisynch.write("PV16.4") == "\x02PV16.4\x03" + chr(reduce(lambda a, b: a ^ b, b"PV16.4\x03"))
    nmea = Frame("${line}*{checksum}", Checksum(kind="xor", over="{line}"), {})
    sentence = "GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,"
    assert nmea.write(sentence) == f"${sentence}*47"
    assert nmea.read(f"${sentence}*47") == (sentence, "")
    assert nmea.read(f"${sentence}*48") == (sentence, "47")
    assert nmea.read(sentence) is None
    pfeiffer = Frame("{line}{checksum:03}", Checksum(kind="sum", **{"as": "decimal"}), {})
    assert pfeiffer.write("0010030902=?") == "0010030902=?107"  # the vacuum protocol's sum of all characters before it
    assert pfeiffer.write("}}}}\x15") == "}}}}\x15009"
    assert pfeiffer.read("0010030902=?107") == ("0010030902=?", "")
    assert pfeiffer.read("0010030902=?7") is None
    modbus = Frame("{line}{checksum}", Checksum(kind="crc16 modbus", **{"as": "binary, low byte first"}), {})
    assert modbus.write("\x01\x04\x00\x00\x00\x01").encode("latin-1")[-2:] == b"\x31\xca"  # a Modbus RTU request


@pytest.mark.parametrize(
    ("wire", "said"),
    [
        (NMEA.replace('over = "{line}"', 'over = "{line}#"'), r"over = '{line}#' is no part of '${line}*{checksum}'"),
        (NMEA.replace("*{checksum}", ""), "neither wire.request nor wire.reply has {checksum}"),
        (r'reply = "{line}{checksum}"', "wire.reply has {checksum}, and wire.checksum does not say which"),
        ('checksum = "crc17"\nrequest = "{line}{checksum}"', "wire.checksum.kind"),
        ('checksum = "crc"\nrequest = "{line}{checksum}"', "a crc needs its polynomial"),
        ('send_end = ""', "does not tell where an answer ends"),
        (BISYNCH + "\necho = true", "needs lines that end with a character of their own"),
    ],
)
def test_frames_that_make_no_sense_are_named(wire, said):
    with pytest.raises(ConfigurationError) as caught:
        driver_class(SOURCE.replace("WIRE", wire))
    assert said in str(caught.value)


X328 = r"""
maker = "ACME"
model = "N1"
parameters = { node = 3 }
[wire]
send_end = ""
frame = "7E1"
request = "\u0004{node:02}{line}\u0005"                       # EOT, address, mnemonic, ENQ
reply = ["\u0002{line}\u0003{checksum}", "\u0006", "\u0015"]  # STX, text, ETX, BCC; or ACK, or NAK
checksum = { kind = "xor", over = "{line}\u0003", as = "binary" }
[errors]
replies = "\u0015"
[identity]
ask = "II"
answer = "II{model}"
[source]
unit = "degC"
low = 0
high = 100
setpoint = { ask = "SL", answer = "SL{value}" }
read = { ask = "PV", answer = "PV{value}" }
safe_value = 20
tolerance = 0.2
[[source.set]]
tell = "SL{value:.1}"
frame = "\u0004{node:02}\u0002{line}\u0003{checksum}"
answer = "\u0006"
"""


def test_questions_and_commands_have_frames_of_their_own_and_ack_is_an_answer():
    """ANSI X3.28-2.5 A4, as older controllers have it."""
    it = DeclaredBench(X328)
    try:
        assert it.it.identify().model == "N1"
        it.it.prepare()
        it.it.set(41.5)
        assert it.it.read().setpoint == 41.5
        body = b"SL41.5\x03"
        asked = b"".join(data for way, data in it.wire if way == "tx")
        assert b"\x0403\x02" + body + bytes((reduce(lambda a, b: a ^ b, body),)) in asked
        assert b"\x0403SL\x05" in asked
        answered = b"".join(data for way, data in it.wire if way == "rx")
        assert b"\x06" in answered
        it.twin._carried_out = lambda line: ("\x15", 0.0)
        with pytest.raises(InstrumentError, match="SL50"):
            it.it.set(50.0)
    finally:
        it.close()


class _Fake(socketserver.BaseRequestHandler):
    """A source whose frames are made here: STX, node, line, ETX, and the CRC of Modbus as two bytes."""

    damage: Callable[[bytes], bytes] = staticmethod(lambda frame: frame)

    @staticmethod
    def crc(data: bytes) -> bytes:
        found = 0xFFFF
        for byte in data:
            found ^= byte
            for _ in range(8):
                found = found >> 1 ^ 0xA001 if found & 1 else found >> 1
        return found.to_bytes(2, "little")

    def handle(self) -> None:
        heard, setpoint = b"", "0.000"
        while got := self.request.recv(64):
            heard += got
            while (end := heard.find(b"\x03")) >= 0 and len(heard) >= end + 3:
                frame, heard = heard[: end + 3], heard[end + 3 :]
                if self.crc(frame[1:-2]) != frame[-2:] or frame[1:3] != b"03":
                    continue
                line = frame[3:-3].decode()
                if line.startswith("SP") and line != "SP?":
                    setpoint, answer = line[2:], "OK"
                else:
                    answer = {"ID": "N1", "SP?": f"SP{setpoint}", "PV?": f"PV {float(setpoint):8.3f}"}[line]
                body = answer.encode() + b"\x03"
                self.request.sendall(b"\x02" + body + self.crc(body))


@contextmanager
def fake() -> Iterator[str]:
    with answering(_Fake) as port:
        yield f"socket://127.0.0.1:{port}"


FAKE = r"""send_end = ""
request = "\u0002{node:02}{line}\u0003{checksum}"
reply = "\u0002{line}\u0003{checksum}"
checksum = { kind = "crc16 modbus", over = "{line}\u0003", as = "binary, low byte first" }"""


def test_a_foreign_source_whose_checksum_of_the_request_has_the_node_in_it(tmp_path):
    """The part of a request may be another one than that of an answer: `over` then has one for each."""
    (tmp_path / "wrong.toml").write_text(SOURCE.replace("WIRE", FAKE))
    right = FAKE.replace(r'over = "{line}\u0003"', r'over = ["{node:02}{line}\u0003", "{line}\u0003"]')
    (tmp_path / "right.toml").write_text(SOURCE.replace("WIRE", right))
    with fake() as address:
        done = rig("instrument", "check", "wrong.toml", "--address", address, cwd=tmp_path)
        assert done.returncode == 1  # it hears nothing that is right, and is silent
        done = rig("instrument", "check", "right.toml", "--address", address, "--set", "41.5", cwd=tmp_path)
        assert done.returncode == 0, done.stdout + done.stderr


def test_silence_and_another_frame_are_told_apart():
    it = bench(MODBUS_LIKE)
    try:
        it.twin._framed = lambda line: "nonsense"
        with pytest.raises(WrongInstrument, match=r"'nonsense' to '<ID>.*' *; expected an answer in its frame, with"):
            it.it.identify()
        it.twin._send = lambda *_: None
        with pytest.raises(NoReply, match="answered nothing"):
            it.it.identify()
    finally:
        it.close()
