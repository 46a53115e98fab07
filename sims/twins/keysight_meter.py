"""The analog-to-digital converter of the simulated 34401A and 34970A: ranges, noise, resolution, time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from typing import Protocol

from rig.sims.noise import event_at, normal
from rig.sims.twins.scpi_syntax import ScpiError, number

OVERLOAD = 9.9e37
"""The reading outside the range (34401A manual)."""

RANGES = (0.1, 1.0, 10.0, 100.0, 1000.0)
"""DC voltage ranges, V; all but the highest measure up to 20 % above their nominal value."""

RESOLUTION = {
    0.02: 1e-4,
    0.2: 1e-5,
    1.0: 3e-6,
    2.0: 2.2e-6,
    10.0: 1e-6,
    20.0: 8e-7,
    100.0: 3e-7,
    200.0: 2.2e-7,
}
"""Specified resolution as a fraction of the range, by integration time in power line cycles.

Those of the 34401A are from its manual; 2, 20 and 200 cycles exist only in the 34970A.
"""

SETTLING_S = {nplc: 0.0015 if nplc >= 1.0 else 0.001 for nplc in RESOLUTION}
"""Automatic trigger delay for DC volts by power line cycles (34401A manual)."""

_LAST_DIGIT = 0.1  # readings are sent ten times finer than the specified resolution, as in recorded data
_WHITE = 4e-8  # noise of a reading that integrates for 1 s, as a fraction of the range [?]
_FLOOR = 2e-8  # noise that integration does not reduce, as a fraction of the range [?]


class Seeded(Protocol):
    """The part of a world's truth about noise."""

    @property
    def seed(self) -> int:
        """Key of all noise."""
        ...


class Plant(Protocol):
    """Parts of the plant that a meter uses."""

    @property
    def truth(self) -> Seeded:
        """The world file's values."""
        ...

    def channel_V(self, instrument: str, channel: str, t0: float, t1: float) -> float:  # noqa: N802
        """Mean voltage at an input over a window, V."""
        ...

    def channel_degC(self, instrument: str, channel: str, t: float) -> float:  # noqa: N802
        """Temperature of the sensor at an input, degrees Celsius."""
        ...


def range_for(volts: float) -> float:
    """The range that autoranging chooses."""
    return next((r for r in RANGES if abs(volts) <= 1.2 * r), RANGES[-1])


@cache
def _noise(aperture: float) -> float:
    """Standard deviation of a reading as a fraction of the range, by its integration time in seconds."""
    return math.hypot(_WHITE / math.sqrt(aperture), _FLOOR)


def reading(plant: Plant, instrument: str, channel: str, t0: float, nplc: float, line_hz: float, fixed: float) -> float:
    """One DC voltage reading.

    Args:
        plant: voltage at the input.
        instrument: the meter's name.
        channel: its input.
        t0: begin of the integration, virtual seconds.
        nplc: integration time, power line cycles.
        line_hz: power line frequency.
        fixed: range, V; 0 chooses one.

    Returns:
        Volts in steps of the range's last digit, or `OVERLOAD` with the sign of the input.
    """
    aperture = nplc / line_hz
    true = plant.channel_V(instrument, channel, t0, t0 + aperture)
    span = fixed or range_for(true)
    if abs(true) > (1.2 if span < RANGES[-1] else 1.05) * span:
        return math.copysign(OVERLOAD, true)
    noisy = true + span * _noise(aperture) * normal(plant.truth.seed, f"{instrument}/{channel}/converter", event_at(t0))
    step = _LAST_DIGIT * RESOLUTION[nplc] * span
    return round(noisy / step) * step


def temperature(
    plant: Plant, instrument: str, channel: str, t0: float, nplc: float, line_hz: float, span: tuple[float, float]
) -> float:
    """One reading of a thermometer, degrees Celsius in steps of 1 mK.

    Args:
        plant: temperature at the input.
        instrument: the meter's name.
        channel: its input.
        t0: begin of the integration, virtual seconds.
        nplc: integration time, power line cycles.
        line_hz: power line frequency.
        span: lowest and highest temperature of the linearisation.

    Returns:
        `OVERLOAD` if the input is open or outside the span.
    """
    aperture = nplc / line_hz
    true = plant.channel_degC(instrument, channel, t0 + aperture / 2)
    if not span[0] <= true <= span[1]:
        return OVERLOAD
    sd = math.hypot(2e-4 / math.sqrt(aperture), 2e-4)
    noisy = true + sd * normal(plant.truth.seed, f"{instrument}/{channel}/converter", event_at(t0))
    return round(noisy, 3)


def text(value: float) -> str:
    """A reading in the instruments' format: +1.23456789E+00."""
    return f"{value:+.8E}"


def nplc_for(request: str, legal: Sequence[float]) -> float:
    """The integration time for a request, power line cycles: the shortest legal one that is long enough."""
    value = parameter(request, min(legal), max(legal), 10.0)
    chosen = next((n for n in legal if n >= value * (1 - 1e-9)), None)
    if chosen is None or value <= 0:
        raise ScpiError(-222)
    return chosen


def range_named(request: str) -> float:
    """The range for a request, V: the lowest that includes the value; 0 for AUTO and DEF."""
    if request.upper() in ("AUTO", "DEF", "DEFAULT"):
        return 0.0
    value = parameter(request, RANGES[0], RANGES[-1], 10.0)
    chosen = next((r for r in RANGES if r >= abs(value)), None)
    if chosen is None:
        raise ScpiError(-222)
    return chosen


def nplc_for_resolution(request: str, span: float, legal: Sequence[float]) -> float:
    """The integration time that gives a resolution in volts on a range (10 V while autoranging)."""
    if request.upper() in ("DEF", "DEFAULT"):
        return 10.0
    scale = span or 10.0
    value = parameter(request, RESOLUTION[legal[-1]] * scale, RESOLUTION[legal[0]] * scale, RESOLUTION[10.0] * scale)
    chosen = next((n for n in legal if RESOLUTION[n] * scale <= value * (1 + 1e-9)), None)
    if chosen is None:
        raise ScpiError(-222)
    return chosen


def parameter(request: str, lowest: float, highest: float, default: float) -> float:
    """A numeric parameter, or the value of MIN, MAX or DEF."""
    match request.upper():
        case "MIN" | "MINIMUM":
            return lowest
        case "MAX" | "MAXIMUM":
            return highest
        case "DEF" | "DEFAULT":
            return default
    return number(request)
