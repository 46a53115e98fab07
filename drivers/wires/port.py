"""The port below a line of text."""

from __future__ import annotations

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
