"""Channels of the simulated 34970A: how many there are, and what may be set for each.

Integration times, thermometers and their ranges from the 34970A/34972A Command Reference, version 2.00.
"""

from __future__ import annotations

from dataclasses import dataclass

from sims.twins.keysight_meter import SETTLING_S

NPLC = (0.02, 0.2, 1.0, 2.0, 10.0, 20.0, 100.0, 200.0)
"""Integration times, power line cycles (Command Reference)."""

CHANNELS = tuple(str(n) for n in range(101, 121))
"""Of a 34901A in slot 100."""

SLOTS = (100, 200, 300)
"""Slots; there is something in the first."""

_THERMISTORS = ("2252", "5000", "10000")
_PLATINUM = ("85", "91")
TYPES = {"THER": _THERMISTORS, "RTD": _PLATINUM, "FRTD": _PLATINUM}
"""Thermometers it linearises: ohms at 25 degrees Celsius (44004, 44007, 44006), or alpha 0.00385 and 0.00391."""

SPANS_DEGC = {"THER": (-80.0, 150.0), "RTD": (-200.0, 600.0), "FRTD": (-200.0, 600.0)}
"""Outside these a thermometer is an overload."""

RELAY_S = 0.0167
"""Closing a 34901A's relay: 60 channels a second."""

VOLTS, DEGREES = "VOLT", "TEMP"


@dataclass(frozen=True)
class Channel:
    """Settings of one channel.

    `range` 0 means autorange, `delay` None an automatic one; `probe` and `type` are a thermometer's.
    """

    function: str = VOLTS
    nplc: float = 1.0
    range: float = 0.0
    probe: str = ""
    type: str = ""
    autozero: bool = True
    fahrenheit: bool = False
    delay: float | None = None

    def settling_s(self) -> float:
        """From the relay to the measurement: automatic unless set."""
        return SETTLING_S[self.nplc] if self.delay is None else self.delay

    def seconds(self, line_hz: float) -> float:
        """Time of a reading: relay, settling, integration, and with autozero a second integration."""
        return RELAY_S + self.settling_s() + (2 if self.autozero else 1) * self.nplc / line_hz
