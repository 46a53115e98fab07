"""What the bench file may say about any serial line, and how pyserial is told."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

from pydantic import BaseModel, Field

from drivers.wires.addresses import SerialAddress

Flow = Literal["none", "rtscts", "xonxoff", "dsrdtr"]
"""Flow control: by the lines RTS and CTS, by the characters XON and XOFF, by the lines DTR and DSR."""

LineEnd = Literal["lf", "cr", "crlf"]

_ENDS: Mapping[LineEnd, bytes] = {"lf": b"\n", "cr": b"\r", "crlf": b"\r\n"}

LINE_END = "what ends a command: lf, cr or crlf"
FLOW = "flow control: none, rtscts, xonxoff or dsrdtr"


class SerialOptions(BaseModel, extra="forbid"):
    """Options that every instrument on a serial line has; one with another factory setting declares it again."""

    line_end: LineEnd = Field("lf", description=LINE_END)
    flow: Flow = Field("none", description=FLOW)

    @property
    def send_end(self) -> bytes:
        """The bytes that end a command."""
        return _ENDS[self.line_end]

    @property
    def reply_end(self) -> bytes:
        """The last byte of an answer, of an instrument whose answers end as it wants commands to end."""
        return _ENDS[self.line_end][-1:]

    def flow_at(self, address: str) -> Flow:
        """Flow control to ask for at an address: a default that was not asked for is nothing to set over TCP."""
        timed = SerialAddress.parse(address).timed
        return self.flow if timed or "flow" in self.model_fields_set else "none"


def flow_refused(flow: Flow, address: SerialAddress) -> str:
    """Why flow control cannot be asked for at an address, and what to do; empty if it can."""
    if flow == "none" or address.timed:
        return ""
    return (
        f'flow = "{flow}" cannot be set over TCP; leave it out and set flow control at the serial server, '
        f"or use rfc2217://, which carries it"
    )


def flow_arguments(flow: Flow) -> dict[str, bool]:
    """Flow control as arguments of a pyserial port."""
    return {name: name == flow for name in ("rtscts", "xonxoff", "dsrdtr")}
