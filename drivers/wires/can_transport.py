"""Transport of CAN frames: python-can's buses behind a small interface."""

from __future__ import annotations

import logging
import os
import threading
from typing import Any, Protocol

import can

from rig.contracts.declared.frames import EXTENDED, REMOTE
from rig.drivers.wires.addresses import CanAddress

logging.getLogger("can").addHandler(logging.NullHandler())  # it prints errors that we raise

_ADAPTER_STARTS_S = 2.0  # serial adapters restart when their port is opened
_ENDS_S = 1.0  # longest wait for a thread that is sending; chosen
_MOST_SKIPPED = 1000  # maximum number of other frames skipped at once

Frame = tuple[int, bytes]
"""Identifier (11 bits; 29 with `EXTENDED` added) and data of a CAN frame."""


class CanTransport(Protocol):
    """Transport of CAN frames. Every method may raise `OSError` or `can.CanError` if the bus is lost."""

    def send(self, can_id: int, data: bytes) -> None:
        """Send a frame."""
        ...

    def repeat(self, can_id: int, data: bytes, seconds: float) -> None:
        """Send a frame now and again after this many real seconds, in place of one that is repeated under its
        identifier, until the bus is closed.
        """
        ...

    def recv(self, seconds: float) -> Frame | None:
        """The next frame, waiting at most this long, in real seconds."""
        ...

    def close(self) -> None:
        """Release the bus; idempotent."""
        ...


class BusTransport:
    """A bus known to python-can. Raises `OSError`, `ValueError` or `can.CanError` if it cannot be opened."""

    def __init__(self, address: CanAddress) -> None:
        options: dict[str, Any] = {}
        if address.bitrate is not None:
            options["bitrate"] = address.bitrate
        if address.interface == "slcan":
            on_terminal = os.path.realpath(address.channel).startswith("/dev/pts/")
            options["sleep_after_open"] = 0.0 if on_terminal else _ADAPTER_STARTS_S
            options.setdefault("bitrate", 500_000)  # an adapter of this kind has none of its own
        if address.interface == "udp_multicast":
            options["hop_limit"] = 0  # a bus between programs of this machine: no command leaves it
        self._bus: can.BusABC | None = can.Bus(address.channel, address.interface, ignore_config=True, **options)
        self._sending = threading.Lock()
        self._repeated: dict[int, _Repeated] = {}

    def send(self, can_id: int, data: bytes) -> None:
        """Send a frame."""
        number, extended = can_id & ~(EXTENDED | REMOTE), bool(can_id & EXTENDED)
        if can_id & REMOTE:
            message = can.Message(arbitration_id=number, is_remote_frame=True, dlc=len(data), is_extended_id=extended)
        else:
            message = can.Message(arbitration_id=number, data=data, is_extended_id=extended)
        with self._sending:
            self._open().send(message)

    def repeat(self, can_id: int, data: bytes, seconds: float) -> None:
        """Send a frame again and again, until the bus is closed. Raises the error that has ended it before."""
        self.send(can_id, data)
        if can_id not in self._repeated:
            self._repeated[can_id] = _Repeated(self, can_id)
        self._repeated[can_id].go_on(data, seconds)

    def recv(self, seconds: float) -> Frame | None:
        """The next frame, waiting at most this long, in real seconds; remote, error and FD frames are skipped."""
        for one in self._repeated.values():
            if one.failed is not None:
                raise one.failed
        for _ in range(_MOST_SKIPPED):
            try:
                message = self._open().recv(seconds)
            except (ValueError, IndexError):  # a serial adapter's line that was torn, since nobody read for long
                continue
            if message is None:
                return None
            if not (message.is_remote_frame or message.is_error_frame or message.is_fd):
                return message.arbitration_id | EXTENDED * message.is_extended_id, bytes(message.data)
            seconds = 0.0  # a data frame may follow
        return None

    def close(self) -> None:
        """Release the bus; idempotent."""
        for one in self._repeated.values():
            one.end()
        self._repeated.clear()
        bus, self._bus = self._bus, None
        if bus is not None:
            bus.shutdown()

    def _open(self) -> can.BusABC:
        if self._bus is None:
            raise OSError("the bus is closed")
        return self._bus


class _Repeated:
    """A frame that is sent again and again, whatever the rest of the program waits for.

    A thread does it: an instrument that wants its command every 100 ms also wants it while a voltmeter on another wire
    takes two seconds to answer. It ends with the program, so that the instrument sees that nobody commands it.

    Attributes:
        failed: the error that ended it, None while it goes on.
    """

    def __init__(self, transport: BusTransport, can_id: int) -> None:
        self.failed: Exception | None = None
        self._transport, self._id = transport, can_id
        self._frame = b"", 0.0
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"can {can_id:X}", daemon=True)

    def go_on(self, data: bytes, seconds: float) -> None:
        """Repeat these data from now on."""
        self._frame = data, seconds
        if self._thread.ident is None:
            self._thread.start()

    def end(self) -> None:
        """Repeat nothing more."""
        self._ended.set()
        if self._thread.ident is not None:
            self._thread.join(_ENDS_S)

    def _run(self) -> None:
        while not self._ended.wait(self._frame[1]):
            try:
                self._transport.send(self._id, self._frame[0])
            except (OSError, can.CanError) as error:  # whoever uses the bus next is told
                self.failed = error
                return
