"""A line to an instrument at a `visa://` address, through pyvisa and the VISA library below it.

GPIB, USB and network instruments exchange whole messages. So an answer is read only after a query: a talker that has
nothing to say would report an error. What was not read after a failure is discarded by device clear (IEEE 488.2, 17.3),
not by listening. A raw socket is a stream and has the rules of `SerialLine`.

pyvisa is an extra and is imported when the first such address is opened. It never repeats a message.
"""

from __future__ import annotations

import contextlib
from typing import Any

from rig.drivers.clock import Clock
from rig.drivers.errors import Unreachable
from rig.drivers.wires.port import Port
from rig.drivers.wires.serial_line import SerialLine
from rig.drivers.wires.serial_port import SerialSettings, Tap
from rig.drivers.wires.visa_address import VisaAddress

_CHUNK = 20_480  # bytes of a read, as pyvisa's own
_LONGEST = 300  # characters of a library's error in our message
_OPEN_S = 5.0  # chosen; finding an instrument on the network takes some of it
_CHARACTERS_PER_S = 5_000.0  # a slow bus; only limits waits


class VisaLine(SerialLine):
    """One instrument at a VISA address; arguments and errors as `SerialLine`."""

    def __init__(
        self, address: str, settings: SerialSettings, clock: Clock, *, label: str = "", tap: Tap | None = None
    ) -> None:
        self._visa: _Session
        super().__init__(address, settings, clock, label=label, tap=tap)

    def _open(self) -> Port:
        self._has_dtr = False
        place = VisaAddress.parse(self.address)
        try:
            self._visa = _Session(place, self.settings.reply_end, self.clock.timeout(_OPEN_S))
        except ImportError as error:
            raise Unreachable(
                f"{self.where} needs a VISA library ({error}): pip install 'calibration-rig[visa]', "
                f"or a maker's VISA and pip install pyvisa"
            ) from error
        except OSError as error:
            raise Unreachable(
                f"{self.where} cannot be opened ({error}); check power, cable and address; "
                f"`pyvisa-info` tells which VISA library there is"
            ) from error
        return self._visa

    def takes_s(self, characters: int) -> float:
        """Maximum bench seconds for this many characters on the line; unknown over TCP."""
        return characters / _CHARACTERS_PER_S if self._place.messages else super().takes_s(characters)

    def drain(self, waiting: int = 0) -> None:
        """Listen until the instrument has been silent for `quiet_s`, and discard its bytes. An instrument that sends
        messages is cleared instead.
        """
        if not self._place.messages:
            super().drain(waiting)
            return
        if self._port is None:
            self._reopened()
        self._cleared()

    def device_clear(self, character: str, *, with_dtr: bool) -> None:
        """Send the character for device clear, and listen until the instrument is silent. The bus has its own; the
        character is for a raw socket.
        """
        if self._place.messages:
            self.drain()
        else:
            super().device_clear(character, with_dtr=False)

    def write(self, text: str) -> None:
        """Send a command without reply. Raises `Unreachable`."""
        self._visa.telling = True
        try:
            super().write(text)
        finally:
            self._visa.telling = False

    def _in_step(self) -> Port:
        if self._port is not None and not self._place.messages:
            try:
                self._visa.listen()  # a stream may hold something that nobody asked for
            except OSError as error:
                self._lost(error)
        return super()._in_step()

    def _cleared(self) -> None:
        try:
            self._visa.clear()
        except OSError as error:
            self._lost(error)
        self._out_of_step = False


class _Session:
    """One VISA session as a port: bytes in and out; every error of the libraries below is an `OSError`.

    Args:
        address: the instrument.
        end: last character of an answer.
        open_s: maximum real seconds for opening it.

    Raises:
        ImportError: pyvisa, or a VISA library below it, is not installed.
        OSError: it cannot be opened.
    """

    dtr = False
    telling = False
    """Whether what is written is a command; else it has an answer, also without a question mark."""

    def __init__(self, address: VisaAddress, end: bytes, open_s: float) -> None:
        import pyvisa  # noqa: PLC0415 - an extra

        self._errors, self._constants = pyvisa.errors.VisaIOError, pyvisa.constants
        self._codes = pyvisa.constants.StatusCode
        self._address, self._messages, self._end, self._open_ms = address, address.messages, end, round(1000 * open_s)
        self._held = bytearray()
        self._asked = False
        self._timeout: float | None = None
        try:
            self._manager: Any = pyvisa.ResourceManager()
        except (ValueError, OSError) as error:  # pyvisa's words for "there is no VISA library"
            raise ImportError(_words(error)) from error
        self._open()

    def _open(self) -> None:
        try:
            self._resource: Any = self._manager.open_resource(self._address.place, open_timeout=self._open_ms)
            if not self._resource.session:  # some libraries return this instead of raising an error
                raise OSError("the VISA library knows no such instrument")
            if not self._messages:
                attribute = self._constants.ResourceAttribute
                self._resource.set_visa_attribute(attribute.termchar, self._end[0])
                self._resource.set_visa_attribute(attribute.termchar_enabled, True)
        except Exception as error:  # libraries below raise what they like, plain Exception included
            raise OSError(_words(error)) from error

    @property
    def timeout(self) -> float | None:
        """Maximum real seconds of a read."""
        return self._timeout

    @timeout.setter
    def timeout(self, seconds: float | None) -> None:
        self._timeout = seconds
        self._set_timeout(0 if seconds is None else max(1, round(1000 * seconds)))

    def _set_timeout(self, milliseconds: int) -> None:
        try:
            self._resource.timeout = milliseconds
        except Exception as error:
            raise OSError(_words(error)) from error

    @property
    def in_waiting(self) -> int:
        """Bytes of an answer that has been read from the bus."""
        return len(self._held)

    def listen(self) -> None:
        """Take what a stream has sent already, without waiting."""
        self._set_timeout(1)
        self._held += self._received()
        if self._timeout is not None:
            self.timeout = self._timeout

    def read(self, size: int = 1, /) -> bytes:
        """Up to `size` bytes of the next answer; none if it does not come in time, or nothing was asked."""
        if not self._held and (self._asked or not self._messages):
            self._held += self._received()
        taken = bytes(self._held[:size])
        del self._held[:size]
        return taken

    def _received(self) -> bytes:
        """One message, or one line of a stream; b"" if there is none in time."""
        library, session = self._resource.visalib, self._resource.session
        found = bytearray()
        try:
            status = None
            while status is None or status == self._codes.success_max_count_read:
                data, status = library.read(session, _CHUNK)
                found += data
        except self._errors as error:
            if error.error_code == self._codes.error_timeout:
                return b""
            raise OSError(_words(error)) from error
        except Exception as error:
            raise OSError(_words(error)) from error
        if self._messages and found and not found.endswith(self._end):
            found += self._end  # the bus has marked the end instead
        return bytes(found)

    def write(self, data: bytes, /) -> int | None:
        """Send one message."""
        try:
            sent: int = self._resource.write_raw(data)
        except Exception as error:
            raise OSError(_words(error)) from error
        self._asked = not self.telling or b"?" in data  # reading after a command that has no answer is an error on GPIB
        return sent

    def clear(self) -> None:
        """Device clear. A library that has none for this bus begins a new session."""
        self._held.clear()
        self._asked = False
        try:
            self._resource.clear()
        except NotImplementedError:
            self._begin_again()
        except self._errors as error:
            if error.error_code != self._codes.error_nonsupported_operation:
                raise OSError(_words(error)) from error
            self._begin_again()
        except Exception as error:
            raise OSError(_words(error)) from error

    def _begin_again(self) -> None:
        self.close()
        self._open()
        if self._timeout is not None:
            self.timeout = self._timeout

    def close(self) -> None:
        """End the session; idempotent. A session that is broken needs no further care."""
        with contextlib.suppress(Exception):
            self._resource.close()


def _words(error: Exception) -> str:
    return " ".join(str(error).split())[:_LONGEST] or type(error).__name__
