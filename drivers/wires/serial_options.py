"""Options of a serial line in the bench file, and as pyserial's arguments."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal, NamedTuple

from pydantic import BaseModel, Field

from rig.drivers.wires.addresses import TextAddress, text_address

Flow = Literal["none", "rtscts", "xonxoff", "dsrdtr"]
"""Flow control: by the lines RTS and CTS, by the characters XON and XOFF, by the lines DTR and DSR."""

LineEnd = Literal["lf", "cr", "crlf"]

_ENDS: Mapping[LineEnd, bytes] = {"lf": b"\n", "cr": b"\r", "crlf": b"\r\n"}

LINE_END = "end of a command: lf, cr or crlf"
FLOW = "flow control: none, rtscts, xonxoff or dsrdtr"


class LineSettings(NamedTuple):
    """Settings of a line that a bench file has.

    Attributes:
        baud: symbols per second.
        frame: data bits, parity, stop bits.
        flow: flow control.
        send_end: end of a line that is sent, if it is not that of the instrument's file.
        serial: whether the instrument's own interface is a serial one.
    """

    baud: int = 9600
    frame: str = "8N1"
    flow: Flow = "none"
    send_end: bytes | None = None
    serial: bool = True


class SerialOptions(BaseModel, extra="forbid"):
    """Options of every instrument on a serial line; an instrument with another factory setting declares them again."""

    line_end: LineEnd = Field("lf", description=LINE_END)
    flow: Flow = Field("none", description=FLOW)

    @property
    def send_end(self) -> bytes:
        """The bytes at the end of a command."""
        return _ENDS[self.line_end]

    @property
    def reply_end(self) -> bytes:
        """The last byte of an answer, for an instrument whose answers end like its commands."""
        return _ENDS[self.line_end][-1:]

    def flow_at(self, address: str) -> Flow:
        """Flow control for an address; a default is not set over TCP."""
        timed = text_address(address).timed
        return self.flow if timed or "flow" in self.model_fields_set else "none"


def flow_refused(flow: Flow, address: TextAddress) -> str:
    """Reason why flow control cannot be set at an address, with the next step; empty if it can."""
    if flow == "none" or address.timed:
        return ""
    if address.messages:
        return f'flow = "{flow}" has no meaning at a VISA address; leave it out'
    return (
        f'flow = "{flow}" cannot be set over TCP; leave it out and set flow control at the serial server, '
        f"or use rfc2217://, which carries it"
    )


def flow_arguments(flow: Flow) -> dict[str, bool]:
    """Flow control as arguments for a pyserial port."""
    return {name: name == flow for name in ("rtscts", "xonxoff", "dsrdtr")}
