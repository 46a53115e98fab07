"""Status system of simulated Druck PACE instruments: event and enable registers, status byte.

Source: SCPI manual K0472, revision A, sections 3.1 to 3.4 (pages 3-1 to 3-9) and the example of page 4-103.
"""

from __future__ import annotations

from rig.sims.twins.scpi import DEVICE_ERROR, ScpiTwin
from rig.sims.twins.scpi_syntax import mask

_ERROR_AVAILABLE, _STANDARD_EVENT, _OPERATION = 4, 32, 128
_PRESSURE_SUMMARY = 1024


class PaceStatus(ScpiTwin):
    """Status of a PACE twin; a subclass gives the events of the pressure."""

    set_operation_enable, ask_operation_enable = mask("_operation_enable")
    set_pressure_enable, ask_pressure_enable = mask("_pressure_enable")

    def switch_on(self) -> None:
        """No events, nothing enabled; no power-on bit: in K0472 it is reserved."""
        self._operation_enable = self._pressure_enable = 0
        self._status = self._status_before = 0
        super().switch_on()
        self.events = 0

    def pressure_events(self) -> int:
        """The pressure event register: events since the last reading."""
        raise NotImplementedError(f"{type(self).__name__} does not say what happens to its pressure")

    def fail(self, code: int) -> None:
        """An error; "device dependent" is reserved and always 0."""
        super().fail(code)
        self.events &= ~DEVICE_ERROR
        self._note_status()

    def clear_status(self) -> None:
        """*CLS: clears events, errors and, unlike in IEEE 488.2, also the enable masks (pages 3-4 and 3-7)."""
        super().clear_status()
        self._event_enable = self._service_enable = 0
        self._status = self._status_before = 0

    def _note_status(self) -> None:
        """Events in the status byte since the last query."""
        now = _ERROR_AVAILABLE * bool(self._queue) + _STANDARD_EVENT * bool(self.events & self._event_enable)
        if self._operation_enable & _PRESSURE_SUMMARY:
            now |= _OPERATION * bool(self.pressure_events() & self._pressure_enable)
        self._status |= now & ~self._status_before
        self._status_before = now

    def ask_status_byte(self) -> str:
        """*STB?: reading clears it (page 4-103)."""
        self._note_status()
        status, self._status = self._status, 0
        return str(status + 64 * bool(status & self._service_enable & ~64))

    def ask_operation_events(self) -> str:
        """:STAT:OPER?: bit 10 sums up the pressure events that are enabled."""
        return str(_PRESSURE_SUMMARY * bool(self.pressure_events() & self._pressure_enable))
