"""Channels of the simulated 34970A: their number, and their possible settings.

Integration times, thermometers and their ranges are from the 34970A/34972A Command Reference, version 2.00.
"""

from __future__ import annotations

from dataclasses import dataclass

from rig.sims.twins.keysight_meter import SETTLING_S

NPLC = (0.02, 0.2, 1.0, 2.0, 10.0, 20.0, 100.0, 200.0)
"""Integration times, power line cycles (Command Reference)."""

CHANNELS = tuple(str(n) for n in range(101, 121))
"""Channels of a 34901A in slot 100."""

SLOTS = (100, 200, 300)
"""Slots; only the first has a card."""

_THERMISTORS = ("2252", "5000", "10000")
_PLATINUM = ("85", "91")
TYPES = {"THER": _THERMISTORS, "RTD": _PLATINUM, "FRTD": _PLATINUM}
"""Types of thermometers: ohms at 25 degrees Celsius (44004, 44007, 44006), or alpha 0.00385 and 0.00391."""

SPANS_DEGC = {"THER": (-80.0, 150.0), "RTD": (-200.0, 600.0), "FRTD": (-200.0, 600.0)}
"""Outside these ranges a thermometer reads an overload."""

RELAY_S = 0.0167
"""Time to close a 34901A's relay: 60 channels per second."""

VOLTS, DEGREES = "VOLT", "TEMP"


@dataclass(frozen=True)
class Channel:
    """Settings of one channel.

    `range` 0 means autorange, `delay` None an automatic delay; `probe` and `type` describe a thermometer.
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
        """Delay between relay and measurement: automatic unless set."""
        return SETTLING_S[self.nplc] if self.delay is None else self.delay

    def seconds(self, line_hz: float) -> float:
        """Duration of a reading: relay, settling, integration, and with autozero a second integration."""
        return RELAY_S + self.settling_s() + (2 if self.autozero else 1) * self.nplc / line_hz
