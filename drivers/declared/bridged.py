"""Talk with an instrument that another library's driver reaches: questions and commands are its attributes."""

from __future__ import annotations

from collections.abc import Mapping

from pydantic import JsonValue

from rig.contracts.declared.bridges import Bridged, bridged
from rig.contracts.declared.exchanges import Ask, Check
from rig.contracts.declared.forms import Form
from rig.contracts.declared.instrument import Instrument
from rig.drivers.bridges import Bridge
from rig.drivers.bridges.line import BridgeLine
from rig.drivers.clock import Clock
from rig.drivers.declared.text import TextTalk
from rig.drivers.errors import WrongAddress
from rig.drivers.wires import SerialSettings, Wires
from rig.drivers.wires.addresses import EpicsAddress, SerialAddress, parse_address
from rig.drivers.wires.line import Line
from rig.drivers.wires.serial_options import LineSettings
from rig.drivers.wires.visa_address import VisaAddress

_WITH_UNIT, _OF_ANY_UNIT = ("{value}", "{value} {unit}"), ("{value}", "{value} {}")


class BridgedTalk(TextTalk):
    """An instrument behind a bridge.

    Args:
        table: its file.
        name: the bench's name for it.
        address: its address; of EPICS and SECoP that of the driver's name.
        parameters: by name.
        wires: where to open it.
        clock: bench time.
    """

    def __init__(
        self,
        table: Instrument,
        name: str,
        address: str,
        parameters: Mapping[str, str | float],
        wires: Wires,
        clock: Clock,
    ) -> None:
        super().__init__(table, name, address, LineSettings(), parameters, wires, clock)

    def _opened(self, table: Instrument, name: str, address: str, settings: LineSettings, wires: Wires) -> Line:
        """The bridge as a line; a library is imported at its first use."""
        of, where = bridged(table.bridge), f"{name} at {address}"
        forms = [Form(line).filled(self._parameters) for line in _readings(table)]

        def fresh(line: str) -> bool:
            return any(form.read(line) is not None for form in forms)

        made = _made(table, of, address, where, name, wires)
        return BridgeLine(made, where, name, fresh, table.wire.timeout_s, wires.clock, wires.tap)

    def _forms(self, one: Ask) -> tuple[str, ...]:
        """Forms of an answer: a library may say the unit of a number."""
        if one.answer or one.words or one is self.table.identity or isinstance(getattr(one, "is_", None), str):
            return one.forms
        return _OF_ANY_UNIT if isinstance(one, Check) or one.asks_bit else _WITH_UNIT


def _readings(table: Instrument) -> list[str]:
    """Questions for readings."""
    every = [ask for place, ask in table.asks() if place.endswith((".reading", ".fetch")) or place == "source.read"]
    return [ask.ask for ask in every if ask.ask]


def _made(table: Instrument, of: Bridged, address: str, where: str, name: str, wires: Wires) -> Bridge:
    if of.kind == "secop":
        from rig.drivers.bridges.secop import SecopBridge  # noqa: PLC0415 - few benches have one

        settings = SerialSettings(9600, timeout_s=table.wire.timeout_s, encoding="utf-8")
        return SecopBridge(wires.serial(address, settings, name), of.what, where)
    from rig.drivers.bridges.process import LibraryBridge  # noqa: PLC0415

    arguments = dict(table.arguments)
    if of.kind == "ophyd":
        arguments["variables"] = _variables(table)
    return LibraryBridge(of, resource(address), arguments, where, wires.clock)


def _variables(table: Instrument) -> list[JsonValue]:
    """All attributes of a file, without holes."""
    lines = [ask.ask for place, ask in table.asks() if place != "identity"]
    lines += [(tell.tell or "").partition(" = ")[0] for _, tell in table.tells()]
    return [line for line in dict.fromkeys(lines) if line and "{" not in line]


def resource(address: str) -> str:
    """The VISA resource of an address; a process variable is itself.

    Example:
        >>> resource("/dev/ttyUSB0"), resource("socket://10.0.0.5:5025"), resource("visa://GPIB0::9::INSTR")
        ('ASRL/dev/ttyUSB0::INSTR', 'TCPIP::10.0.0.5::5025::SOCKET', 'GPIB0::9::INSTR')
    """
    found = parse_address(address, "bridge")
    if isinstance(found, EpicsAddress | VisaAddress):
        return found.place
    if isinstance(found, SerialAddress) and found.kind == "socket" and found.host is not None:
        return f"TCPIP::{found.host.host}::{found.host.port}::SOCKET"
    if not isinstance(found, SerialAddress) or found.kind != "device":
        raise WrongAddress(f"{address} is no place for a bridge: give it /dev/NAME, COM4, socket:// or visa://")
    return f"ASRL{found.place if found.place.startswith('/') else found.place[3:]}::INSTR"
