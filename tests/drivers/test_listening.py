"""A line on which an instrument talks by itself, on a real socket: old lines and torn ones are not read."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator

import pytest

from rig.drivers.clock import RealClock
from rig.drivers.errors import BadReply, NoReply
from rig.drivers.wires.serial_line import SerialLine, SerialSettings


@pytest.fixture
def ends() -> Iterator[tuple[SerialLine, socket.socket]]:
    """Our end, and the instrument's."""
    server = socket.create_server(("127.0.0.1", 0))
    line = SerialLine(
        f"socket://127.0.0.1:{server.getsockname()[1]}", SerialSettings(9600, reply_end=b"\n"), RealClock()
    )
    instrument, _ = server.accept()
    yield line, instrument
    line.close()
    instrument.close()
    server.close()


def say(instrument: socket.socket, *pieces: bytes) -> None:
    """Send pieces one by one, from another thread, when the line listens."""

    def send() -> None:
        for piece in pieces:
            threading.Event().wait(0.25)  # it is heard by then
            instrument.sendall(piece)

    threading.Thread(target=send, daemon=True).start()


def test_what_was_said_before_is_old(ends):
    line, instrument = ends
    instrument.sendall(b"old 1\r\nold 2\r\nold 3\r\n" * 200)
    threading.Event().wait(0.05)
    say(instrument, b"new\r\n")
    assert line.heard(2.0) == "new"


def test_a_line_that_has_begun_before_is_torn(ends):
    line, instrument = ends
    instrument.sendall(b"old\r\ntor")
    threading.Event().wait(0.05)
    say(instrument, b"n\r\nwh", b"ole\r\n")
    assert line.heard(2.0) == "whole"


def test_the_next_line_begins_where_the_last_one_ended(ends):
    line, instrument = ends
    say(instrument, b"torn\r\n", b"first\r\n")
    assert line.heard(2.0) == "first"
    say(instrument, b"second\r\n")
    assert line.heard(2.0) == "second"


def test_silence_and_noise_are_errors(ends):
    line, instrument = ends
    with pytest.raises(NoReply, match="answered nothing"):
        line.heard(0.1)
    say(instrument, b"\r\n", b"\xff\xfe\r\n")
    with pytest.raises(BadReply, match="do baud rate and frame match"):
        line.heard(2.0)


def test_lines_that_come_together_are_heard_one_by_one(ends):
    line, instrument = ends
    say(instrument, b"torn\r\n", b"# remark\r\nfirst\r\nsec", b"ond\r\n")
    assert line.heard(2.0) == "# remark"
    assert line.heard(2.0, onwards=True) == "first"
    assert line.heard(2.0, onwards=True) == "second"
    with pytest.raises(NoReply):
        line.heard(0.05, onwards=True)
