"""VISA addresses: `visa://` and a resource name of message-based instruments, as vendors print it.

A resource name is checked and written in one form here, so that plans, dry runs and locks need no VISA library. Only
the resource classes listed here are opened: serial ports have an address of their own.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal

from rig.drivers.errors import WrongAddress
from rig.drivers.wires.hosts import HostPort, host_wrong

SCHEME = "visa://"
EXAMPLES = (
    "visa://GPIB0::9::INSTR, visa://USB0::0x2A8D::0x1301::MY12345678::INSTR, visa://TCPIP::HOST::INSTR or "
    "visa://TCPIP::HOST::5025::SOCKET"
)

_GPIB = re.compile(r"GPIB(?P<board>\d{0,2})::(?P<first>\d{1,2})(?:::(?P<second>\d{1,2}))?(?:::INSTR)?", re.ASCII)
_USB = re.compile(
    r"USB(?P<board>\d{0,2})::(?P<maker>0X[0-9A-F]{1,4}|\d{1,5})::(?P<model>0X[0-9A-F]{1,4}|\d{1,5})"
    r"::(?P<serial>[\w.-]+?)(?:::(?P<interface>\d{1,3}))?(?:::INSTR)?",
    re.ASCII,
)
_LAN = re.compile(
    r"TCPIP(?P<board>\d{0,2})::(?P<host>[\w.-]+)(?:::(?P<device>INST\d{1,2}|HISLIP\d{1,2}(?:,\d{1,5})?|GPIB\d,\d{1,2}))?(?:::INSTR)?",
    re.ASCII,
)
_SOCKET = re.compile(r"TCPIP(?P<board>\d{0,2})::(?P<host>[\w.-]+)::(?P<port>\d{1,5})::SOCKET", re.ASCII)
_MOST_GPIB = 30


@dataclass(frozen=True)
class VisaAddress:
    """Address of an instrument that a VISA library reaches.

    Attributes:
        kind: its bus; "socket" is a raw TCP connection, the others carry messages and device clear.
        place: the resource name in one form: `GPIB0::9::INSTR`.
        host: host and port of a "socket"; port 0 for other instruments on the network.
    """

    kind: Literal["gpib", "usb", "lan", "socket"]
    place: str
    host: HostPort | None = None

    @classmethod
    def parse(cls, address: str) -> VisaAddress:
        """Read `visa://RESOURCE`.

        Raises:
            WrongAddress: the resource is not one of a message-based instrument.
        """
        name = address.removeprefix(SCHEME)
        upper = name.upper()
        if found := _GPIB.fullmatch(upper):
            made = _gpib(found)
        elif found := _USB.fullmatch(upper):
            made = _usb(found, name)
        elif found := _SOCKET.fullmatch(upper):
            made = _socket(found, name)
        elif found := _LAN.fullmatch(upper):
            made = _lan(found, name)
        elif upper.startswith("ASRL"):
            made = "a serial port is opened without VISA: write its device, /dev/ttyUSB0 or COM4"
        else:
            made = f"{name!r} is not a resource name of this kind"
        if isinstance(made, str):
            raise WrongAddress(f"{address} is not a VISA address; write {EXAMPLES} ({made})")
        return made

    @property
    def timed(self) -> bool:
        """Whether baud rate and frame are set when it is opened: a message has none."""
        return False

    @property
    def simulated(self) -> bool:
        """Whether it is a twin in this process."""
        return False

    @property
    def device(self) -> None:
        """The device file behind it: the library's business."""

    @property
    def lock(self) -> str:
        """Name of the instrument for locks: the same for the names that it certainly has."""
        if self.host is not None:
            name = self.place.split("::")[2].partition(",")[0].replace("hislip", "inst")
            return f"visa:{self.host.host.lower().rstrip('.')}:{name}"
        return "visa:" + (self.place if self.kind == "gpib" else self.place.partition("::")[2])

    @property
    def messages(self) -> bool:
        """Whether the bus itself marks the end of a message and has a device clear."""
        return self.kind != "socket"


def _board(found: re.Match[str]) -> int:
    return int(found["board"] or 0)


def _gpib(found: re.Match[str]) -> VisaAddress | str:
    numbers = [int(found["first"]), *([int(found["second"])] if found["second"] else [])]
    if max(numbers) > _MOST_GPIB:
        return f"GPIB addresses are 0 to {_MOST_GPIB}"
    return VisaAddress("gpib", f"GPIB{_board(found)}::{'::'.join(map(str, numbers))}::INSTR")


def _usb(found: re.Match[str], name: str) -> VisaAddress | str:
    maker, model = (
        int(found[key], 0) if found[key].startswith("0X") else int(found[key]) for key in ("maker", "model")
    )
    if max(maker, model) > 0xFFFF:
        return "maker and model numbers have 16 bits"
    serial = name[found.start("serial") : found.end("serial")]
    interface = int(found["interface"] or 0)
    return VisaAddress("usb", f"USB{_board(found)}::0x{maker:04X}::0x{model:04X}::{serial}::{interface}::INSTR")


def _socket(found: re.Match[str], name: str) -> VisaAddress | str:
    host, port = name[found.start("host") : found.end("host")], int(found["port"])
    if why := host_wrong(host):
        return why
    if not 1 <= port <= 65535:
        return f"port {port} is not 1 to 65535"
    return VisaAddress("socket", f"TCPIP{_board(found)}::{host}::{port}::SOCKET", HostPort(host, port))


def _lan(found: re.Match[str], name: str) -> VisaAddress | str:
    host = name[found.start("host") : found.end("host")]
    if why := host_wrong(host):
        return why
    device = (found["device"] or "inst0").lower()
    return VisaAddress("lan", f"TCPIP{_board(found)}::{host}::{device}::INSTR", HostPort(host, 0))
