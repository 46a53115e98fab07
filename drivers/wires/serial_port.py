"""The port of a serial line: its settings, and how it is opened, opened again, and lost."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal, NoReturn, cast

from rig.drivers.clock import Clock
from rig.drivers.errors import Unreachable
from rig.drivers.wires.addresses import text_address
from rig.drivers.wires.parity import opener
from rig.drivers.wires.port import Port, without_delay
from rig.drivers.wires.serial_options import Flow, flow_arguments, flow_refused

try:
    import termios

    PORT_ERRORS: tuple[type[Exception], ...] = (OSError, termios.error)  # pyserial does not convert the latter
except ImportError:  # Windows has no termios; its port errors are all OSError
    PORT_ERRORS = (OSError,)

Frame = Literal["7E1", "7E2", "7O1", "7O2", "8N1", "8N2", "8E1", "8O1"]
"""Data bits, parity, stop bits, as printed in manuals of instruments."""

Tap = Callable[[str, str, bytes], None]
"""Called with (instrument, "tx" or "rx", bytes) for every transfer."""

_OPEN_ERRORS: tuple[type[Exception], ...] = (*PORT_ERRORS, ValueError)
_WRITE_TIMEOUT_S = 5.0  # flow control may hold up a port for ever
QUIET_S = 0.3
"""Bench seconds of silence, if a driver does not say otherwise: longer than any pause within an answer."""


@dataclass(frozen=True)
class SerialSettings:
    """Settings of an instrument's line.

    Attributes:
        baud: symbols per second.
        frame: data bits, parity, stop bits.
        flow: flow control of a real port; a pseudo-terminal or a simulated line has none.
        send_end: end of a command.
        reply_end: last character of a reply; white space around a reply is not part of it.
        timeout_s: bench seconds within which an ordinary reply is complete.
        quiet_s: bench seconds of silence after which the line counts as synchronised again.
        sync: a question without side effects that is only used for synchronisation, and a pattern of all its answers;
            None if there is none, and silence must be enough.
        encoding: of replies, and of commands; with Latin-1 any byte may be part of an answer.
    """

    baud: int
    frame: Frame = "8N1"
    flow: Flow = "none"
    send_end: bytes = b"\n"
    reply_end: bytes = b"\n"
    timeout_s: float = 1.0
    quiet_s: float = field(default_factory=lambda: QUIET_S)
    sync: tuple[str, str] | None = None
    encoding: Literal["ascii", "utf-8", "latin-1"] = "ascii"


class PortOfLine:
    """The port of a line, as `rig.drivers.wires.serial_line.SerialLine` uses it.

    Args:
        address: see `rig.drivers.wires.addresses`.
        settings: settings of the instrument's line.
        clock: bench time.
        label: name of the instrument, for messages and the wire log.

    Attributes:
        user: which of several instruments behind it was addressed last.

    Raises:
        Unreachable: the address cannot be opened.
    """

    def __init__(self, address: str, settings: SerialSettings, clock: Clock, label: str) -> None:
        self.address = address
        self._place = text_address(address)
        self.settings = settings
        self.clock = clock
        self.label = label or address
        self.user: object = None
        self._out_of_step = False
        self._parity = False  # whether the frame of the open port has one; of a VISA instrument none
        self._port: Port | None = self._open()

    @property
    def where(self) -> str:
        """The instrument and its address, for messages."""
        return self.label if self.label == self.address else f"{self.label} at {self.address}"

    @property
    def rs232(self) -> bool:
        """Whether the instrument may be at a serial line: not if its bus has messages, as GPIB."""
        return not self._place.messages

    @property
    def port_settings(self) -> str:
        """Settings of the port, for messages; empty over TCP, where they are the serial server's."""
        if not self._place.timed:
            return ""
        flow = "" if self.settings.flow == "none" else f", flow control {self.settings.flow}"
        return f"{self.settings.baud} baud {self.settings.frame}{flow}"

    def close(self) -> None:
        """Release the port; idempotent. The line opens again at its next use."""
        port, self._port = self._port, None
        if port is not None:
            port.close()

    def _open(self) -> Port:
        settings = self.settings
        if refused := flow_refused(settings.flow, self._place):
            raise Unreachable(f"{self.where}: {refused}")
        # A pseudo-terminal carries whole bytes, refuses every other frame and has no flow control lines.
        terminal = os.path.realpath(self._place.place).startswith("/dev/pts/")
        self._has_dtr = self._place.timed and not terminal
        frame = "8N1" if terminal else settings.frame
        self._parity = frame[1] != "N"
        try:
            port = opener(self._place.place, frame)(
                self._place.place,
                baudrate=settings.baud,
                bytesize=int(frame[0]),
                parity=frame[1],
                stopbits=int(frame[2]),
                timeout=self.clock.timeout(settings.timeout_s),
                write_timeout=None if "://" in self._place.place else _WRITE_TIMEOUT_S,  # rfc2217:// refuses one
                exclusive=True,  # a terminal program on the same port would take answers away
                **flow_arguments("none" if terminal else settings.flow),
            )
            return without_delay(cast(Port, port))
        except _OPEN_ERRORS as error:
            raise Unreachable(
                f"{self.where} cannot be opened ({error}); check power, cable, address and permissions"
            ) from error

    def _reopened(self) -> Port:
        self._port = port = self._open()
        self._out_of_step, self.user = True, None
        return port

    def _limit(self, port: Port, timeout_s: float) -> None:
        limit = self.clock.timeout(timeout_s)
        if port.timeout != limit:  # setting it reprograms a real port, so it is set only if it changes
            port.timeout = limit

    def _lost(self, error: BaseException) -> NoReturn:
        port, self._port = self._port, None
        if port is not None:
            with contextlib.suppress(*PORT_ERRORS):  # it is gone already, and this is being reported
                port.close()
        raise Unreachable(f"{self.where} was lost ({error}); check cable and power") from error
