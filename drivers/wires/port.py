"""The port below a line of text."""

from __future__ import annotations

import socket
from typing import Protocol


class Port(Protocol):
    """The used part of a pyserial port; pyserial's own base class does not declare all of it."""

    timeout: float | None
    dtr: bool

    @property
    def in_waiting(self) -> int:
        """Number of received bytes."""
        ...

    def read(self, size: int = 1, /) -> bytes:
        """Up to `size` bytes; fewer if the timeout passes first."""
        ...

    def write(self, data: bytes, /) -> int | None:
        """Send bytes."""
        ...

    def close(self) -> None:
        """Release it."""
        ...


def without_delay(port: Port) -> Port:
    """A port that sends each line at once. Raises `OSError`.

    TCP would hold back a line until the one before is acknowledged, which takes up to 40 ms; pyserial leaves it so.
    """
    over_tcp = getattr(port, "_socket", None)
    if isinstance(over_tcp, socket.socket):
        over_tcp.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return port
