"""Wires: connections to instruments. Each is opened once and shared by the instruments declared on it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from rig.drivers.clock import Clock
from rig.drivers.errors import Unreachable
from rig.drivers.wires.addresses import text_address
from rig.drivers.wires.serial_line import SerialLine
from rig.drivers.wires.serial_options import SerialOptions
from rig.drivers.wires.serial_port import SerialSettings, Tap
from rig.drivers.wires.visa_address import VisaAddress

if TYPE_CHECKING:
    from rig.drivers.wires.can import CanLine, CanWires
    from rig.drivers.wires.modbus import ModbusLine, ModbusWires

__all__ = ["SerialLine", "SerialOptions", "SerialSettings", "Tap", "Wires"]


class Wires:
    """Opens each wire once and shares it between the instruments declared on it.

    Args:
        clock: bench time.
        simulated: for a dry run, by kind ("modbus", "can"), a factory that takes a `sim://KEY/INSTRUMENT` address and
            returns the simulated wire. Serial `sim://` addresses go through pyserial instead.
        tap: called for every transfer on every wire, with (instrument, "tx" or "rx", bytes).

    Attributes:
        clock, tap: as given.
    """

    def __init__(
        self,
        clock: Clock,
        *,
        simulated: Mapping[str, Callable[[str], Any]] | None = None,
        tap: Tap | None = None,
    ) -> None:
        self._simulated = simulated or {}
        self.clock = clock
        self.tap = tap
        self._serial: dict[str, SerialLine] = {}
        # these two are imported only for benches that have them: the import takes a tenth of a second
        self._modbus: ModbusWires | None = None
        self._can: CanWires | None = None

    def serial(self, address: str, settings: SerialSettings, name: str = "") -> SerialLine:
        """The serial line at `address`.

        Args:
            address: `/dev/NAME`, `COM4`, `socket://HOST:PORT`, `rfc2217://HOST:PORT`, or `visa://RESOURCE`.
            settings: settings of the instrument's line.
            name: the bench's name for the instrument, used in messages.

        Raises:
            Unreachable: it cannot be opened, or is already open with other settings.
        """
        line = self._serial.get(address)
        if line is None:
            kind = _line_class(address)
            line = self._serial[address] = kind(address, settings, self.clock, label=name, tap=self.tap)
        elif line.settings != settings:
            raise Unreachable(
                f"{name or address}: {line.where} already uses this line{line.port_settings and ' at '}"
                f"{line.port_settings}; instruments on one line must agree on its settings"
            )
        return line

    def modbus(self, address: str, name: str = "", timeout_s: float = 1.0) -> ModbusLine:
        """The device at `address`.

        Args:
            address: `modbus-tcp://host:502/1`, `modbus-rtu:///dev/ttyUSB1/1` or `modbus-rtu://socket://host:4001/1`;
                the last number is the unit.
            name: the bench's name for the device, used in messages.
            timeout_s: bench seconds to wait for a reply.

        Raises:
            Unreachable: the connection or line cannot be opened, or is already open with other settings.

        """
        if self._modbus is None:
            from rig.drivers.wires.modbus import ModbusWires  # noqa: PLC0415

            self._modbus = ModbusWires(self.clock, self._simulated.get("modbus"), self.tap)
        return self._modbus.line(address, name, timeout_s)

    def can(self, address: str, name: str = "") -> CanLine:
        """The CAN bus at `address`.

        Args:
            address: `can:socketcan/can0`, `can:slcan//dev/ttyACM0`, or another of python-can's interfaces.
            name: the bench's name for the instrument, used in messages.

        Raises:
            Unreachable: the bus cannot be opened.

        """
        if self._can is None:
            from rig.drivers.wires.can import CanWires  # noqa: PLC0415

            self._can = CanWires(self.clock, self._simulated.get("can"), self.tap)
        return self._can.line(address, name)

    def close(self) -> None:
        """Release every wire; idempotent."""
        for wires in (self._modbus, self._can, *self._serial.values()):
            if wires is not None:
                wires.close()
        self._serial.clear()


def _line_class(address: str) -> type[SerialLine]:
    if not isinstance(text_address(address), VisaAddress):
        return SerialLine
    from rig.drivers.wires.visa import VisaLine  # noqa: PLC0415 - only for benches that have one

    return VisaLine
