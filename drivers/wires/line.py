"""A line, as a talk in lines of text needs it: a serial line, a VISA resource, or a bridge."""

from __future__ import annotations

from typing import Protocol

from rig.drivers.errors import BadReply
from rig.drivers.wires.serial_line import Whole


class Line(Protocol):
    """See `rig.drivers.wires.serial_line.SerialLine`, which has all of it.

    Attributes:
        user: which of several instruments behind it was addressed last.
    """

    user: object

    @property
    def where(self) -> str:
        """The instrument and its address, for messages."""
        ...

    @property
    def rs232(self) -> bool:
        """Whether it may be a serial line of the instrument, wherever it passes on the way."""
        ...

    def device_clear(self, character: str, *, with_dtr: bool) -> None:
        """Have the instrument give up what it does, and listen until it is silent."""
        ...

    def write(self, text: str) -> None:
        """Send a command without reply."""
        ...

    def query_lines(
        self,
        text: str,
        count: int,
        timeout_s: float | None = None,
        *,
        repeat: bool = True,
        whole: Whole | None = None,
    ) -> list[str]:
        """Send a question with `count` lines of answer."""
        ...

    def heard(self, timeout_s: float, *, onwards: bool = False) -> str:
        """The first line that begins from now on; with `onwards` the one after the last."""
        ...

    def drain(self, waiting: int = 0) -> None:
        """Listen until it is silent."""
        ...

    def beyond(self) -> str:
        """Lines that come after a whole answer; "" if none does."""
        ...

    def bad_reply(self, text: str, reply: object, expected: str) -> BadReply:
        """The error for an answer that makes no sense."""
        ...

    def takes_s(self, characters: int) -> float:
        """Maximum bench seconds for this many characters."""
        ...

    def close(self) -> None:
        """Release it; idempotent."""
        ...
