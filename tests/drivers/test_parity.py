"""Parity of serial lines: checked on receive where the frame has one."""

from __future__ import annotations

import os
import pty
import termios

import pytest
import serial
from test_serial_line import Parrot, parrot

from rig.drivers.errors import BadReply
from rig.drivers.wires.parity import CheckedPort, opener


def flags_of(fd: int) -> tuple[bool, ...]:
    iflag = termios.tcgetattr(fd)[0]
    return tuple(bool(iflag & flag) for flag in (termios.INPCK, termios.IGNPAR, termios.PARMRK))


def test_the_terminals_check_is_on_and_stays_on_when_a_timeout_changes() -> None:
    ours, theirs = pty.openpty()
    with serial.Serial(os.ttyname(theirs)) as plain:
        assert flags_of(plain.fd)[0] is False, "pyserial alone checks nothing"
    with CheckedPort(os.ttyname(theirs), timeout=1.0) as port:
        assert flags_of(port.fd) == (True, False, False)
        port.timeout = 2.0
        assert flags_of(port.fd) == (True, False, False)
        os.write(ours, b"1.25\n")
        assert port.read(5) == b"1.25\n"
    os.close(ours)
    os.close(theirs)


@pytest.mark.parametrize(
    ("place", "frame", "checked"),
    [
        ("/dev/rig/dvm", "7E2", True),
        ("/dev/rig/dvm", "8O1", True),
        ("COM4", "7E1", True),
        ("/dev/rig/dvm", "8N1", False),
        ("socket://127.0.0.1:4001", "7E2", False),
        ("rfc2217://127.0.0.1:4001", "7E2", False),
    ],
)
def test_ports_of_this_machine_with_parity_are_checked(place: str, frame: str, checked: bool) -> None:
    assert (opener(place, frame) is CheckedPort) is checked


def test_a_character_with_a_wrong_parity_is_asked_for_again_where_that_is_safe(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Parrot, "frame", "7E2")
    _, twin, line, _ = parrot(frame="7E2")
    twin.answers = [(0.01, b"1.2\x00456\n"), (0.01, b"1.23456\n")]
    assert line.query("READ?") == "1.23456"
    assert line.retries == 1


def test_a_character_with_a_wrong_parity_is_never_a_value(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Parrot, "frame", "7E2")
    _, twin, line, _ = parrot(frame="7E2")
    twin.answers = [(0.01, b"1.2\x00456\n"), (0.01, b"1.\x003456\n")]
    with pytest.raises(BadReply, match="characters with the right parity"):
        line.query("READ?")
    twin.answers = [(0.01, b"1.2\x00456\n")]
    with pytest.raises(BadReply, match="characters with the right parity"):
        line.query("READ?", repeat=False)
    assert len(twin.heard) == 3
