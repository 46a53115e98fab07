"""Transport of CAN frames: python-can's buses behind a small interface."""

from __future__ import annotations

import logging
import os
from typing import Any, Protocol

import can

from rig.drivers.wires.addresses import CanAddress

logging.getLogger("can").addHandler(logging.NullHandler())  # it prints errors that we raise

_ADAPTER_STARTS_S = 2.0  # serial adapters restart when their port is opened
_MOST_SKIPPED = 1000  # maximum number of other frames skipped at once

Frame = tuple[int, bytes]
"""Identifier (11 bits) and data of a CAN frame."""


class CanTransport(Protocol):
    """Transport of CAN frames. Every method may raise `OSError` or `can.CanError` if the bus is lost."""

    def send(self, can_id: int, data: bytes) -> None:
        """Send a frame."""
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
        self._bus: can.BusABC | None = can.Bus(address.channel, address.interface, ignore_config=True, **options)

    def send(self, can_id: int, data: bytes) -> None:
        """Send a frame."""
        self._open().send(can.Message(arbitration_id=can_id, data=data, is_extended_id=False))

    def recv(self, seconds: float) -> Frame | None:
        """The next frame, waiting at most this long, in real seconds; extended, remote and error frames are skipped."""
        message = self._open().recv(seconds)
        for _ in range(_MOST_SKIPPED):
            if message is None:
                return None
            if not (message.is_extended_id or message.is_remote_frame or message.is_error_frame):
                return message.arbitration_id, bytes(message.data)
            message = self._open().recv(0.0)  # a data frame may follow
        return None

    def close(self) -> None:
        """Release the bus; idempotent."""
        bus, self._bus = self._bus, None
        if bus is not None:
            bus.shutdown()

    def _open(self) -> can.BusABC:
        if self._bus is None:
            raise OSError("the bus is closed")
        return self._bus
