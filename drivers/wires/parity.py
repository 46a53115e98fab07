"""Parity that is checked on receive.

pyserial sets a port's parity for sending, and switches its check on receive off on POSIX systems (INPCK). A character
with one wrong bit then passes as another digit. Here the check is on: the driver of the port gives such a character as
NUL, which no instrument sends in a text. Source: POSIX.1-2017, 11.2.2 (INPCK without IGNPAR and PARMRK).

A pseudo-terminal has no parity, and a serial server (socket://, rfc2217://) checks it or not by its own settings.
"""

from __future__ import annotations

import contextlib
import sys
from typing import Any

import serial

with contextlib.suppress(ImportError):  # Windows has no termios: there pyserial switches the check on
    import termios

WRONG_PARITY = b"\0"
"""A character that came with a wrong parity."""
_IFLAG = 0


class CheckedPort(serial.Serial):
    """A serial port that checks the parity of what it receives."""

    def _reconfigure_port(self, *args: Any, **kwargs: Any) -> None:
        """Called by pyserial for every change of a setting, also of a timeout."""
        super()._reconfigure_port(*args, **kwargs)  # type: ignore[misc]  # its stubs have no private methods
        if sys.platform != "win32":
            assert self.fd is not None  # pyserial calls this while it opens, when `fileno` still refuses
            attributes = termios.tcgetattr(self.fd)
            attributes[_IFLAG] = attributes[_IFLAG] & ~(termios.IGNPAR | termios.PARMRK) | termios.INPCK
            termios.tcsetattr(self.fd, termios.TCSANOW, attributes)


def opener(place: str, frame: str) -> Any:
    """What opens a port: one that checks parity if the frame has parity and the port is of this machine."""
    return serial.serial_for_url if frame[1] == "N" or "://" in place else CheckedPort
