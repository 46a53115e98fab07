"""Addresses of instruments: one parser for the checks of bench files and for the wires.

Only the kinds of addresses listed here can be opened. Other schemes and options of a library below are refused: a
pyserial URL can write files or load modules.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar, Literal
from urllib.parse import parse_qsl

from rig.drivers.errors import WrongAddress
from rig.drivers.wires.hosts import HostPort, host_wrong
from rig.drivers.wires.ports import DEVICE, is_ip, is_port
from rig.drivers.wires.visa_address import SCHEME, VisaAddress

_HOST = r"[A-Za-z0-9](?:[A-Za-z0-9._-]*[A-Za-z0-9])?\.?|\[[0-9A-Fa-f:.]+\]"
_HOST_PORT = re.compile(rf"(?P<host>{_HOST})(?::(?P<port>[0-9]{{1,5}}))?")
_SIMULATED = re.compile(r"sim://[\w.-]+/[\w.-]+")
_VISA = re.compile(r"(?P<scheme>visa://)?(?P<bus>GPIB|TCPIP|ASRL|USB|VXI|PXI|PRLGX)(?P<rest>[^:]*::.*)", re.IGNORECASE)
_BAUDS = ("1200", "2400", "4800", "9600", "14400", "19200", "28800", "38400", "57600", "115200")
_FRAMES = ("8N1", "8N2", "8E1", "8E2", "8O1", "8O2")
_FRAMES_OF = {"modbus-rtu": _FRAMES, "modbus-ascii": ("7E1", "7O1", "7N2", *_FRAMES)}
_MODBUS_PORT = 502
_SERIAL_EXAMPLES = "/dev/ttyUSB0 (or COM4), socket://HOST:5025, rfc2217://HOST:4001 or visa://GPIB0::9::INSTR"
_MODBUS_EXAMPLES = (
    "modbus-tcp://HOST:502/UNIT or modbus-rtu:///dev/ttyUSB0/UNIT?baud=9600&frame=8N1 or "
    "modbus-rtu://socket://HOST:4001/UNIT, modbus-ascii: likewise"
)
_CAN_EXAMPLES = "can:socketcan/can0, can:slcan//dev/ttyACM0?bitrate=500000 or can:virtual/NAME"
_CAN_CHANNELS = {
    "socketcan": r"[A-Za-z0-9][\w.-]{0,14}",
    "virtual": r"[\w.-]+",
    "udp_multicast": r"2(2[4-9]|3[0-9])\.[0-9]{1,3}\.[0-9]{1,3}\.[0-9]{1,3}|[Ff][Ff][0-9A-Fa-f]{2}:[0-9A-Fa-f:]+",
    "kvaser": r"[0-9]{1,3}",
    "pcan": r"PCAN_[A-Z]+[0-9]{1,2}",
    "ixxat": r"[0-9]{1,3}",
    "vector": r"[0-9]{1,3}",
    "gs_usb": r"[0-9]{1,3}",
}
"""python-can's adapters that may be opened, with the pattern of their channels; slcan is on a serial device."""

_EPICS = re.compile(r"epics:[!-~]{1,60}")

Wire = Literal["serial", "modbus", "can", "bridge"]


@dataclass(frozen=True)
class SerialAddress:
    """Address of a serial instrument.

    Attributes:
        kind: "device"; "socket" (bytes over TCP); "rfc2217" (a serial port over TCP); "sim" and "sim-socket" for twins
            of these; "sim-visa" for the twin of an instrument at a VISA address.
        place: name for pyserial.
        host: host of a network address.
    """

    kind: Literal["device", "socket", "rfc2217", "sim", "sim-socket", "sim-visa"]
    place: str
    host: HostPort | None = None

    @classmethod
    def parse(cls, address: str) -> SerialAddress:
        """Read an address.

        `/dev/NAME`, `COM4`, `socket://HOST:PORT`, `rfc2217://HOST:PORT[?OPTION]`, `sim://KEY/NAME`,
        `socket://sim://KEY/NAME` or `visa://sim://KEY/NAME`.

        Raises:
            WrongAddress: it has none of these forms.
        """
        if _SIMULATED.fullmatch(address):
            return cls("sim", address)
        if _SIMULATED.fullmatch(address.removeprefix("socket://")):
            return cls("sim-socket", address.removeprefix("socket://"))
        if _SIMULATED.fullmatch(address.removeprefix(SCHEME)):
            return cls("sim-visa", address.removeprefix(SCHEME))
        if is_port(address):
            return cls("device", address)
        scheme, separator, rest = address.partition("://")
        place, question, query = rest.partition("?")
        if separator and scheme in ("socket", "rfc2217"):
            why = _serial_options(scheme, query) if question else ""
            host = _host_port(place, None)
            why = why or (host if isinstance(host, str) else "")
            if not why and isinstance(host, HostPort):
                return cls("socket" if scheme == "socket" else "rfc2217", address, host)
        else:
            why = _unknown(scheme if separator else "", address)
        raise _wrong(address, "an address of a serial line", _SERIAL_EXAMPLES, why)

    @property
    def timed(self) -> bool:
        """Whether baud rate and frame are set when it is opened: a serial server has its own settings."""
        return self.kind not in ("socket", "sim-socket", "sim-visa")

    @property
    def simulated(self) -> bool:
        """Whether it is a twin in this process."""
        return self.kind in ("sim", "sim-socket", "sim-visa")

    @property
    def device(self) -> str | None:
        """The device file behind it, if there is one."""
        return self.place if self.kind == "device" else None

    @property
    def messages(self) -> bool:
        """Whether the bus of the instrument itself marks the end of a message and has a device clear."""
        return self.kind == "sim-visa"


@dataclass(frozen=True)
class ModbusAddress:
    """Address of a Modbus device.

    Attributes:
        kind: "tcp"; "rtu" on a serial line; "rtu-over-tcp" behind a serial server; "sim" or "sim-rtu" simulated.
        place: the opened place: "host:port", a serial device, or the simulated address.
        unit: unit identifier.
        baud: symbols per second of a serial line; 9600 is the factory setting of a Watlow F4T.
        frame: data bits, parity, stop bits of a serial line.
        host: host of a network address.
        ascii: whether frames are lines of hexadecimal digits: Modbus ASCII, not RTU.
    """

    kind: Literal["tcp", "rtu", "rtu-over-tcp", "sim", "sim-rtu"]
    place: str
    unit: int
    baud: int = 9600
    frame: str = "8N1"
    host: HostPort | None = field(default=None, compare=False)
    ascii: bool = False

    @classmethod
    def parse(cls, address: str) -> ModbusAddress:
        """Read an address.

        `modbus-tcp://HOST[:PORT]/UNIT`, `modbus-rtu:///dev/NAME/UNIT[?baud=B&frame=8N1]`, `sim://KEY/NAME`,
        `modbus-rtu://socket://HOST:PORT/UNIT` (both also `modbus-ascii:`), or `modbus-rtu://sim://KEY/NAME/UNIT`.

        Raises:
            WrongAddress: it has none of these forms.
        """
        if _SIMULATED.fullmatch(address):
            return cls("sim", address, 1)
        scheme, separator, rest = address.partition("://")
        if not separator or scheme not in ("modbus-tcp", "modbus-rtu", "modbus-ascii"):
            raise _no_modbus(address, _unknown(scheme if separator else "", address))
        way, _, query = rest.partition("?")
        place, _, last = way.rpartition("/")
        if not last.isascii() or not last.isdigit() or not place:
            raise _no_modbus(address, "it does not end in the device's unit, as in .../1")
        unit = int(last)
        if scheme != "modbus-tcp":
            options, ascii_ = query if "?" in rest else None, scheme == "modbus-ascii"
            return replace(cls._rtu(address, place, unit, options, _FRAMES_OF[scheme]), ascii=ascii_)
        host = _host_port(place, _MODBUS_PORT)
        if isinstance(host, str):
            raise _no_modbus(address, host)
        if "?" in rest:
            raise _no_modbus(address, "modbus-tcp takes no options")
        if unit > 255:
            raise _no_modbus(address, f"unit {unit} is not 0 to 255")
        return cls("tcp", f"{host.host}:{host.port}", unit, host=host)

    @classmethod
    def _rtu(cls, address: str, place: str, unit: int, query: str | None, frames: Sequence[str]) -> ModbusAddress:
        if not 1 <= unit <= 247:
            raise _no_modbus(address, f"unit {unit} is not 1 to 247")
        if place.startswith("socket://"):
            host = _host_port(place.removeprefix("socket://"), None)
            if isinstance(host, str):
                raise _no_modbus(address, host)
            if query is not None:
                raise _no_modbus(address, "baud rate and frame are set at the serial server; leave the options out")
            return cls("rtu-over-tcp", f"{host.host}:{host.port}", unit, host=host)
        if _SIMULATED.fullmatch(place):
            return cls("sim-rtu", place, unit)
        device = place.removeprefix("/") if re.fullmatch(r"/COM[0-9]+", place, re.IGNORECASE) else place
        if not is_port(device):
            raise _no_modbus(address, f"{place} is not a serial device")
        pairs = parse_qsl(query or "", keep_blank_values=True)
        given = dict(pairs)
        if len(given) < len(pairs):
            raise _no_modbus(address, "an option is given twice")
        unknown = given.keys() - {"baud", "frame"}
        if unknown or (query is not None and not given):
            raise _no_modbus(address, f"its options are baud and frame, not {', '.join(sorted(unknown)) or query!r}")
        baud, frame = given.get("baud", "9600"), given.get("frame", frames[0])
        for key, value, known in (("baud", baud, _BAUDS), ("frame", frame, frames)):
            if value not in known:
                raise _no_modbus(address, f"{key}={value} is not one of {', '.join(known)}")
        return cls("rtu", device, unit, int(baud), frame)

    @property
    def rtu(self) -> bool:
        """Whether the device receives requests at its serial port, whatever carries the bytes part of the way."""
        return self.kind in ("rtu", "rtu-over-tcp", "sim-rtu")

    @property
    def simulated(self) -> bool:
        """Whether it is a twin in this process."""
        return self.kind in ("sim", "sim-rtu")

    @property
    def device(self) -> str | None:
        """The device file behind it, if there is one."""
        return self.place if self.kind == "rtu" else None


@dataclass(frozen=True)
class CanAddress:
    """Address of a CAN bus.

    Attributes:
        interface: python-can's name for the kind of adapter, or "sim" for a simulated bus.
        channel: name of the channel: "can0", a serial device, a name, or the whole simulated address.
        bitrate: bits per second; None for the adapter's own setting.
    """

    interface: str
    channel: str
    bitrate: int | None = None
    host: ClassVar[HostPort | None] = None

    @classmethod
    def parse(cls, address: str) -> CanAddress:
        """Read `can:INTERFACE/CHANNEL[?bitrate=B]` or `sim://...`.

        Raises:
            WrongAddress: it has neither form.
        """
        if _SIMULATED.fullmatch(address):
            return cls("sim", address)
        if not address.startswith("can:"):
            scheme, separator, _ = address.partition("://")
            raise _wrong(address, "a CAN address", _CAN_EXAMPLES, _unknown(scheme if separator else "", address))
        way, question, query = address.removeprefix("can:").partition("?")
        interface, _, channel = way.partition("/")
        interface = interface.lower()
        given = dict(parse_qsl(query, keep_blank_values=True))
        rate = given.pop("bitrate", None)
        if interface == "slcan":
            known = is_port(channel.partition("@")[0]) and is_port(channel)
        else:
            known = re.fullmatch(_CAN_CHANNELS.get(interface, r"(?!)"), channel) is not None
            known = known and (interface != "udp_multicast" or is_ip(channel))
        if interface not in (*_CAN_CHANNELS, "slcan"):
            why = f"adapters are {', '.join(sorted((*_CAN_CHANNELS, 'slcan')))}, not {interface!r}"
        elif not known:
            why = f"{channel!r} is not a channel of {interface}"
        elif given or (question and rate is None):
            why = "its only option is bitrate"
        elif rate is not None and not re.fullmatch(r"[1-9][0-9]{3,6}", rate):
            why = f"bitrate={rate} is not a number of bits per second"
        else:
            return cls(interface, channel, None if rate is None else int(rate))
        raise _wrong(address, "a CAN address", _CAN_EXAMPLES, why)

    @property
    def simulated(self) -> bool:
        """Whether it is a twin in this process."""
        return self.interface == "sim"

    @property
    def device(self) -> str | None:
        """The device file behind it, if there is one."""
        return self.channel.partition("@")[0] if self.interface == "slcan" else None


@dataclass(frozen=True)
class EpicsAddress:
    """Name of an EPICS process variable, or the begin of several; which host has it, the network is asked.

    Attributes:
        place: the name.
    """

    place: str
    host: ClassVar[HostPort | None] = None
    device: ClassVar[str | None] = None
    simulated: ClassVar[bool] = False


TextAddress = SerialAddress | VisaAddress
Address = TextAddress | ModbusAddress | CanAddress | EpicsAddress


def text_address(address: str) -> TextAddress:
    """Read the address of an instrument that takes lines of text.

    Raises:
        WrongAddress: it is not on a serial line and has no VISA name.
    """
    if address.startswith(SCHEME) and not _SIMULATED.fullmatch(address.removeprefix(SCHEME)):
        return VisaAddress.parse(address)
    return SerialAddress.parse(address)


def parse_address(address: str, wire: Wire | None = None) -> Address:
    """Read an instrument's address.

    Args:
        address: as in the bench file.
        wire: kind of its driver's wire; None permits any address.

    Raises:
        WrongAddress: an address of this kind may not be opened; the message says what to write instead.
    """
    if wire == "modbus" or (wire is None and address.startswith("modbus-")):
        return ModbusAddress.parse(address)
    if wire == "can" or (wire is None and address.startswith("can:")):
        return CanAddress.parse(address)
    if wire in ("bridge", None) and _EPICS.fullmatch(address):
        return EpicsAddress(address.partition(":")[2])
    return text_address(address)


def messages(address: str) -> bool:
    """Whether an address is of an instrument whose bus has messages and device clear, as GPIB."""
    return address.startswith(SCHEME) and text_address(address).messages


def simulated(address: str, place: str) -> str:
    """The address of the twin at `place` (`sim://KEY/NAME`) that replaces the instrument at `address`."""
    if messages(address):
        return f"{SCHEME}{place}"
    if address.startswith(("socket:", SCHEME)):
        return f"socket://{place}"
    if address.startswith("modbus-rtu:"):
        return f"modbus-rtu://{place}/1"
    return place


def _host_port(text: str, default: int | None) -> HostPort | str:
    """A host and its port, or the defect of the text."""
    found = _HOST_PORT.fullmatch(text)
    if found is None:
        return f"{text!r} is not HOST:PORT" if text else "it names no host"
    port = found["port"]
    if port is None and default is None:
        return "it names no port"
    number = int(port) if port is not None else default
    if number is None or not 1 <= number <= 65535:
        return f"port {port} is not 1 to 65535"
    host = found["host"]
    why = host_wrong(host)
    return why or HostPort(host.strip("[]"), number)


def _serial_options(scheme: str, query: str) -> str:
    """Defect of the options of a serial address over the network, "" if none."""
    if scheme == "rfc2217":
        for key, value in parse_qsl(query, keep_blank_values=True) or [(query, "")]:
            flag = key in ("ign_set_control", "poll_modem") and not value
            if not flag and not (key == "timeout" and re.fullmatch(r"[0-9]{1,3}(\.[0-9]+)?", value)):
                return f"its options are ign_set_control, poll_modem and timeout=SECONDS, not {key!r}"
        return ""
    return f"socket:// takes no options such as {query!r}; the driver's options are separate keys in the bench file"


def _unknown(scheme: str, address: str) -> str:
    """Reason for refusing an address of unknown scheme."""
    visa = _VISA.fullmatch(address)
    if visa is not None:
        return _with_visa(visa)
    if scheme == "sim":
        return "sim:// is for simulated benches"
    if scheme or re.match(r"\w+:", address):
        return f"{scheme or address.partition(':')[0]}: is not a wire of this driver, or is not permitted"
    if address.startswith("/"):
        if DEVICE.fullmatch(address):
            return "it is not a serial port, or its path contains . or .. or is too long"
        return "a path has no spaces and no options; the driver's options are separate keys in the bench file"
    return "give the absolute path of a device"


def _with_visa(visa: re.Match[str]) -> str:
    bus, rest = visa["bus"].upper(), visa["rest"]
    if visa["scheme"]:
        return "VISA is for instruments that take text"
    if bus in ("GPIB", "USB", "TCPIP"):
        return f"a VISA name is written {SCHEME}{bus}{rest}, for an instrument that takes text"
    if bus == "ASRL":
        port = rest.partition("::")[0]
        return f"use {port}" if port.startswith("/") else f"use the serial device: /dev/ttyUSB0 or so, or COM{port}"
    return "of VISA names only those of GPIB, USB and TCPIP instruments can be used"


def _no_modbus(address: str, why: str) -> WrongAddress:
    return _wrong(address, "a Modbus address", _MODBUS_EXAMPLES, why)


def _wrong(address: str, what: str, examples: str, why: str) -> WrongAddress:
    return WrongAddress(f"{address} is not {what}; write {examples} ({why})")
