"""Wires: what instruments are connected by. Each is opened once and shared by the instruments declared on it."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from drivers.clock import Clock
from drivers.errors import Unreachable
from drivers.wires.serial_line import SerialLine, SerialSettings, Tap

__all__ = ["SerialLine", "SerialSettings", "Tap", "Wires"]


class Wires:
    """Opens each wire once and shares it between the instruments declared on it.

    Args:
        clock: bench time.
        simulated: for a dry run, by kind ("modbus", "can"), a factory that takes a `sim://KEY/INSTRUMENT` address
            and returns what stands in for the wire. Serial `sim://` addresses go through pyserial instead.
        tap: sees every byte on every wire, as (instrument, "tx" or "rx", bytes).

    """

    def __init__(
        self,
        clock: Clock,
        *,
        simulated: Mapping[str, Callable[[str], object]] | None = None,
        tap: Tap | None = None,
    ) -> None:
        self._clock = clock
        self._simulated = dict(simulated or {})
        self._tap = tap
        self._serial: dict[str, SerialLine] = {}

    def serial(self, address: str, settings: SerialSettings, name: str = "") -> SerialLine:
        """The serial line at `address`.

        Args:
            address: any address pyserial understands.
            settings: how the instrument wants to be talked to.
            name: the bench's name for the instrument, used in messages.

        Raises:
            Unreachable: it cannot be opened, or is already open with other settings.

        """
        line = self._serial.get(address)
        if line is None:
            line = self._serial[address] = SerialLine(address, settings, self._clock, label=name, tap=self._tap)
        elif line.settings != settings:
            raise Unreachable(
                f"{name or address}: {line.where} already uses this line at {line.settings.baud} baud "
                f"{line.settings.frame}; instruments on one line must agree on its settings"
            )
        return line

    def close(self) -> None:
        """Release every wire; idempotent."""
        for line in self._serial.values():
            line.close()
        self._serial.clear()
