"""What carries CAN frames: addresses, and python-can's buses behind one small face."""

from __future__ import annotations

import logging
import os
import re
from dataclasses import dataclass
from typing import Any, Protocol
from urllib.parse import parse_qs, urlsplit

import can

from drivers.errors import Unreachable

logging.getLogger("can").addHandler(logging.NullHandler())  # it prints what we raise

_ADAPTER_STARTS_S = 2.0  # serial adapters restart when their port is opened
_MOST_SKIPPED = 1000  # frames of other kinds taken at once

Frame = tuple[int, bytes]
"""Identifier (11 bits) and data of a CAN frame."""


@dataclass(frozen=True)
class CanAddress:
    """Where a CAN bus is.

    Attributes:
        interface: python-can's name for the kind of adapter, or "sim" for a simulated bus.
        channel: which of them: "can0", a serial device, a name, or the whole simulated address.
        bitrate: bits per second; None leaves it to the adapter.

    """

    interface: str
    channel: str
    bitrate: int | None = None

    @classmethod
    def parse(cls, address: str) -> CanAddress:
        """Read `can:INTERFACE/CHANNEL[?bitrate=B]` or `sim://...`.

        Raises:
            Unreachable: it is neither.

        """
        if address.startswith("sim://"):
            return cls("sim", address)
        parts = urlsplit(address)
        interface, _, channel = parts.path.partition("/")
        try:
            given = {key: values[-1] for key, values in parse_qs(parts.query, strict_parsing=bool(parts.query)).items()}
            bitrate = int(given.pop("bitrate")) if "bitrate" in given else None
        except ValueError:
            given = {"?": ""}
        if parts.scheme != "can" or not re.fullmatch(r"\w+", interface) or not channel or given:
            raise Unreachable(
                f"{address} is not a CAN address; write can:socketcan/can0, can:slcan//dev/ttyACM0?bitrate=500000 or "
                f"can:virtual/NAME"
            )
        return cls(interface, channel, bitrate)


class CanTransport(Protocol):
    """What carries the frames. Every method may raise `OSError` or `can.CanError` when the bus is gone."""

    def send(self, can_id: int, data: bytes) -> None:
        """Send a frame."""
        ...

    def recv(self, seconds: float) -> Frame | None:
        """The next frame, waiting at most that long for it."""
        ...

    def close(self) -> None:
        """Release the bus; idempotent."""
        ...


class BusTransport:
    """A bus that python-can knows. Raises `OSError`, `ValueError` or `can.CanError` if it cannot be opened."""

    def __init__(self, address: CanAddress) -> None:
        options: dict[str, Any] = {}
        if address.bitrate is not None:
            options["bitrate"] = address.bitrate
        if address.interface == "slcan":
            on_terminal = os.path.realpath(address.channel).startswith("/dev/pts/")
            options["sleep_after_open"] = 0.0 if on_terminal else _ADAPTER_STARTS_S
            options.setdefault("bitrate", 500_000)
        self._bus: can.BusABC | None = can.Bus(address.channel, address.interface, ignore_config=True, **options)

    def send(self, can_id: int, data: bytes) -> None:
        """See `CanTransport.send`."""
        self._open().send(can.Message(arbitration_id=can_id, data=data, is_extended_id=False))

    def recv(self, seconds: float) -> Frame | None:
        """See `CanTransport.recv`; extended, remote and error frames are not for us."""
        message = self._open().recv(seconds)
        for _ in range(_MOST_SKIPPED):
            if message is None:
                return None
            if not (message.is_extended_id or message.is_remote_frame or message.is_error_frame):
                return message.arbitration_id, bytes(message.data)
            message = self._open().recv(0.0)  # one of ours may have come behind it
        return None

    def close(self) -> None:
        """See `CanTransport.close`."""
        bus, self._bus = self._bus, None
        if bus is not None:
            bus.shutdown()

    def _open(self) -> can.BusABC:
        if self._bus is None:
            raise OSError("the bus is closed")
        return self._bus
