"""A serial line stays in step: late and partial replies, chatter, lost ports, on sim:// and on a pseudo-terminal."""

from __future__ import annotations

import contextlib
import os
import pty
import select
import socket
import threading
from types import SimpleNamespace

import pytest
import serial
from serial.rfc2217 import PortManager
from serial_bench import Recorder, plug_in

from rig.drivers.clock import RealClock
from rig.drivers.errors import BadReply, NoReply, Unreachable
from rig.drivers.wires import SerialLine, SerialSettings, Wires
from rig.sims.wires.serial_line import find
from rig.sims.world import World


class Parrot:
    """Answers after a set time with set bytes; keeps what it hears."""

    kind = "serial"
    name = "parrot"
    frame = "8N1"

    def __init__(self, world, baud=9600):
        self.world = world
        self.baud = baud
        self.heard = []
        self.heard_at = []
        self.answers = []

    def on_rx(self, data, tx):
        self.heard.append(data)
        self.heard_at.append(self.world.now())
        if self.answers:
            delay, answer = self.answers.pop(0)
            self.world.call_in(delay, lambda: tx(answer))


def parrot(**settings):
    world = World()
    twin = Parrot(world)
    address = plug_in(world, twin)
    tap = Recorder()
    line = Wires(world, tap=tap).serial(address, SerialSettings(9600, timeout_s=1.0, **settings), "parrot")
    return world, twin, line, tap


def test_an_exchange_takes_the_time_its_baud_rate_takes():
    world, twin, line, _ = parrot()
    twin.answers = [(0.0, b"1234567\r\n")]
    assert line.query("ABC") == "1234567"
    assert twin.heard_at == [pytest.approx(4 * 10 / 9600)]
    assert world.now() == pytest.approx((4 + 9) * 10 / 9600)
    assert line.exchanges == 1


def test_a_late_reply_does_not_answer_the_next_question():
    world, twin, line, _ = parrot()
    twin.answers = [(1.2, b"late\n"), (0.01, b"right\n")]
    with pytest.raises(NoReply, match=r"parrot at sim://.* answered nothing to 'A' within 1 s"):
        line.query("A", repeat=False)
    world.sleep(0.0)
    assert line.query("B") == "right"


def test_a_reply_that_comes_between_questions_is_not_taken_for_an_answer():
    world, twin, line, _ = parrot()
    twin.answers = [(2.0, b"late\n"), (0.01, b"right\n")]
    with pytest.raises(NoReply):
        line.query("A", repeat=False)
    world.sleep(5.0)
    assert line.query("B") == "right"


def test_a_question_may_be_repeated_once_and_that_is_counted():
    _, twin, line, _ = parrot()
    twin.answers = [(99.0, b""), (0.01, b"second\n")]
    assert line.query("A") == "second"
    assert (line.exchanges, line.retries) == (2, 1)
    assert twin.heard == [b"A\n", b"A\n"]


def test_a_command_is_never_repeated():
    world, twin, line, _ = parrot()
    line.write("GO")
    world.sleep(10.0)
    assert twin.heard == [b"GO\n"]


@pytest.mark.parametrize(
    ("flow", "asked"), [("none", r"9600 baud 8N1\?"), ("rtscts", "9600 baud 8N1, flow control rtscts")]
)
def test_silence_names_all_settings_of_the_port(flow, asked):
    _, _, line, _ = parrot(flow=flow)
    with pytest.raises(NoReply, match=f"set to {asked}"):
        line.query("A")


def test_part_of_a_reply_is_no_reply():
    _, twin, line, _ = parrot()
    twin.answers = [(0.01, b"+1.23")]
    with pytest.raises(NoReply, match=r"answered only b'\+1\.23'"):
        line.query("A", repeat=False)


def test_more_lines_than_asked_for_are_a_bad_reply():
    _, twin, line, _ = parrot()
    twin.answers = [(0.01, b"one\r\ntwo\r\n"), (0.01, b"three\n")]
    with pytest.raises(BadReply, match="expected 1 line"):
        line.query("A")
    assert line.query("B") == "three"


def test_several_lines_of_answer():
    _, twin, line, _ = parrot()
    twin.answers = [(0.01, b"one\r\ntwo\r\n")]
    assert line.query_lines("A;B", 2) == ["one", "two"]


def test_bytes_that_are_no_text_suggest_baud_rate_and_frame():
    _, twin, line, _ = parrot()
    twin.answers = [(0.01, b"\xf7\x80\n")]
    with pytest.raises(BadReply, match="do baud rate and frame match"):
        line.query("A")


@pytest.mark.parametrize(
    ("end", "chunks"),
    [
        (b"\n", [b"\x11+1.0\x130\x11000E+00\r\n"]),  # as a 34970A sends them, in the middle of a number
        (b"\n", [b"\x13", b"+1.00000E", b"\x11", b"+00\r", b"\x13\n\x11"]),
        (b"\r", [b"\x11+1.00000E+00\x13\r"]),
        (b"\r", [b"+1.00000E+00\r\n"]),  # the LF comes after the answer is complete
    ],
)
def test_flow_control_characters_are_no_part_of_an_answer(end, chunks):
    world, twin, line, _ = parrot(reply_end=end, flow="xonxoff")
    cable = find(line.address.removeprefix("sim://"))
    for n, chunk in enumerate(chunks):
        world.call_in(0.02 + 0.3 * n, lambda chunk=chunk: cable._answer(chunk))
    assert line.query("A") == "+1.00000E+00"
    twin.answers = [(0.01, b"next" + end)]
    before = world.now()
    assert line.query("B") == "next"
    assert (line.retries, world.now() - before < 0.1) == (0, True), "no reason to suspect the line"


def test_one_changed_bit_of_a_digit_is_not_taken_for_flow_control():
    """0x31 is a 1 and 0x11 is XON: without the character, 13.5 would be 3.5."""
    _, twin, line, _ = parrot()
    twin.answers = [(0.01, b"\x113.5\r\n"), (0.01, b"13.5\r\n")]
    assert line.query("A") == "13.5"
    assert line.retries == 1


def test_an_instrument_that_uses_flow_control_undeclared_is_understood_if_it_says_the_same_twice():
    _, twin, line, _ = parrot()
    twin.answers = [(0.01, b"\x131\x113.5\n"), (0.01, b"1\x133.5\x11\n"), (0.01, b"1\x113.5\n"), (0.01, b"1\x113.6\n")]
    assert line.query("A") == "13.5"
    with pytest.raises(BadReply, match='if the instrument sends them, write flow = "xonxoff"'):
        line.query("B")


def test_an_instrument_that_sends_only_flow_control_is_silent():
    world, _, line, _ = parrot()
    cable = find(line.address.removeprefix("sim://"))

    def live():
        cable._answer(b"\x11")
        world.call_in(0.4, live)

    live()
    with pytest.raises(NoReply, match="answered nothing"):
        line.query("A")
    assert world.now() < 6.0


def test_a_late_answer_is_recognised_whatever_ends_it():
    _, twin, line, _ = parrot(reply_end=b"\r", sync=("V?", "1999"))
    twin.answers = [(1.2, b"late\r\n"), (0.01, b"1999.0\r\n"), (0.01, b"right\r\n")]
    with pytest.raises(NoReply):
        line.query("A", repeat=False)
    assert line.query("B") == "right"


def test_an_instrument_that_never_stops_talking_is_named():
    world, _, line, _ = parrot()
    cable = find(line.address.removeprefix("sim://"))

    def talk():
        cable._answer(b"blah\n")
        world.call_in(0.1, talk)

    talk()
    world.sleep(1.0)
    with pytest.raises(BadReply, match="sends without being asked"):
        line.query("A")


def test_the_tap_sees_every_byte_in_order():
    _, twin, line, tap = parrot()
    twin.answers = [(0.01, b"one\n"), (0.01, b"two\n")]
    line.query("A")
    line.write("B")
    assert tap.log == [("tx", b"A\n"), ("rx", b"one\n"), ("tx", b"B\n")]


def test_wires_open_a_line_once_and_share_it():
    world, _, line, _ = parrot()
    wires = Wires(world)
    line.close()
    first = wires.serial(line.address, SerialSettings(9600), "one")
    assert wires.serial(line.address, SerialSettings(9600), "two") is first
    with pytest.raises(Unreachable, match=r"two: one at .* already uses this line at 9600 baud 8N1"):
        wires.serial(line.address, SerialSettings(19200), "two")
    wires.close()
    wires.close()


def test_a_second_controller_is_refused():
    world, _, line, _ = parrot()
    with pytest.raises(Unreachable, match="already open"):
        Wires(world).serial(line.address, SerialSettings(9600), "other")


@pytest.mark.parametrize("address", ["/dev/no-such-port", "sim://nowhere/dvm", "socket://127.0.0.1:1"])
def test_an_address_that_cannot_be_opened_is_unreachable(address):
    with pytest.raises(Unreachable, match=r"dvm at .* cannot be opened .*check power, cable, address"):
        Wires(RealClock()).serial(address, SerialSettings(9600), "dvm")


class Terminal:
    """A pseudo-terminal with an instrument of one line of code at its other end, in a thread."""

    def __init__(self, answer):
        self.master, self._slave = pty.openpty()
        self.name = os.ttyname(self._slave)
        self._gone = threading.Event()
        self._thread = threading.Thread(target=self._serve, args=(answer,), daemon=True)
        self._thread.start()

    def _serve(self, answer):
        with contextlib.suppress(OSError):
            while not self._gone.is_set():
                if select.select([self.master], [], [], 0.01)[0]:
                    os.write(self.master, answer(os.read(self.master, 1000)))

    def hang_up(self):
        self._gone.set()
        self._thread.join()  # a closed file's number is given to the next one opened
        os.close(self._slave)
        os.close(self.master)


@pytest.mark.parametrize(("frame", "flow"), [("8N1", "none"), ("7E2", "xonxoff"), ("8N1", "rtscts"), ("8N1", "dsrdtr")])
def test_a_pseudo_terminal_can_be_opened_again_and_again_with_any_frame_and_flow_control(frame, flow):
    terminal = Terminal(lambda data: b"echo " + data.replace(b"\n", b"\r\n"))
    for _ in range(3):
        line = SerialLine(terminal.name, SerialSettings(9600, frame, flow), RealClock(), label="dvm")
        assert line.query("hello") == "echo hello"
        line.close()
    terminal.hang_up()


def test_a_peer_that_goes_away_is_unreachable_not_a_traceback():
    terminal = Terminal(lambda data: b"here\n")
    line = SerialLine(terminal.name, SerialSettings(9600), RealClock(), label="dvm")
    assert line.query("A") == "here"
    terminal.hang_up()
    with pytest.raises((Unreachable, NoReply)):
        line.query("A")
    with pytest.raises((Unreachable, NoReply), match="dvm at /dev/pts/"):
        line.query("A")
    line.close()


def test_a_silent_terminal_is_no_reply_in_real_time():
    master, slave = pty.openpty()
    line = SerialLine(os.ttyname(slave), SerialSettings(9600, timeout_s=0.1, quiet_s=0.05), RealClock())
    with pytest.raises(NoReply):
        line.query("A")
    assert line.retries == 1
    line.close()
    os.close(master)
    os.close(slave)


class NetworkServer:
    """A serial server on the loopback interface: bytes come back as they were, through RFC 2217 or plainly."""

    def __init__(self, rfc2217):
        self.port = serial.serial_for_url("loop://", timeout=0.0)
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.address = f"127.0.0.1:{self._listening.getsockname()[1]}"
        threading.Thread(target=self._serve, args=(rfc2217,), daemon=True).start()

    def _serve(self, rfc2217):
        client, _ = self._listening.accept()
        manager = PortManager(self.port, SimpleNamespace(write=client.sendall)) if rfc2217 else None
        with client, self._listening, contextlib.suppress(OSError):
            while data := client.recv(1000):
                answer = b"".join(manager.filter(data)) if manager else data
                if answer:
                    client.sendall(answer)


@pytest.mark.filterwarnings("ignore:set(Daemon|Name):DeprecationWarning")  # pyserial's own
@pytest.mark.parametrize(("flow", "carried"), [("none", (0, 0)), ("rtscts", (1, 0)), ("xonxoff", (0, 1))])
def test_flow_control_reaches_the_serial_server_that_can_be_told(flow, carried):
    server = NetworkServer(rfc2217=True)
    line = SerialLine(f"rfc2217://{server.address}", SerialSettings(9600, flow=flow), RealClock(), label="dvm")
    assert line.query("hello") == "hello"
    assert (server.port.rtscts, server.port.xonxoff) == carried
    line.close()


def test_flow_control_that_tcp_cannot_carry_is_refused():
    with pytest.raises(Unreachable, match=r'dvm at socket://.*: flow = "rtscts" cannot be set over TCP; leave it out'):
        SerialLine("socket://127.0.0.1:1", SerialSettings(9600, flow="rtscts"), RealClock(), label="dvm")


def test_over_tcp_nobody_is_sent_to_look_at_a_baud_rate():
    """It is the serial server's, or there is none."""
    listening = socket.create_server(("127.0.0.1", 0))
    address = f"socket://127.0.0.1:{listening.getsockname()[1]}"
    wires = Wires(RealClock())
    line = wires.serial(address, SerialSettings(9600, timeout_s=0.05, quiet_s=0.01), "dvm")
    client, _ = listening.accept()
    with pytest.raises(NoReply) as silent:
        line.query("A")
    with pytest.raises(Unreachable) as other:
        wires.serial(address, SerialSettings(19200), "two")
    assert "server" in str(silent.value)
    assert not any("baud" in str(told.value) or "8N1" in str(told.value) for told in (silent, other))
    wires.close()
    client.close()
    listening.close()


@pytest.mark.filterwarnings("ignore:set(Daemon|Name):DeprecationWarning")  # pyserial's own
@pytest.mark.parametrize("scheme", ["socket", "rfc2217"])
def test_serial_servers_on_the_network(scheme):
    server = NetworkServer(scheme == "rfc2217")
    wires = Wires(RealClock())
    line = wires.serial(f"{scheme}://{server.address}", SerialSettings(9600, "7E2"), "dvm")
    assert line.query("hello") == "hello"
    assert line.query("again", 0.5) == "again"
    if scheme == "rfc2217":
        assert (server.port.baudrate, server.port.bytesize, server.port.parity, server.port.stopbits) == (
            9600,
            7,
            "E",
            2,
        )
    wires.close()


def test_a_port_of_a_dead_program_that_is_closed_late_does_not_cut_off_its_successor():
    """Python closes a port when it collects it, at any time: a night then was not the same again."""
    world, twin, old, _ = parrot()
    find(old.address.removeprefix("sim://")).attach(None)  # its program has died
    new = Wires(world).serial(old.address, SerialSettings(9600, timeout_s=1.0), "parrot")
    old.close()
    twin.answers = [(0.0, b"here\r\n")]
    assert new.query("A") == "here"
