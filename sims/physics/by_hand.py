"""Changes that a person makes to the bench by hand, by the words of procedure files.

What another part is like is drawn from the world's seed and the number of such changes so far, so that the same
changes in the same order make the same bench. A word that is not here changes nothing.
"""

# ruff: noqa: N802  (a quantity's name ends in its unit, and units keep their own case)

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field, replace

from rig.sims.noise import normal
from rig.sims.physics.fields import BySensor, Number, Switch, accepts, quantity
from rig.sims.physics.undeclared import Effects

PADS_LOCKED, REMOUNTED, OTHER_VOLTMETER, OTHER_GAUGE = "pads-locked", "remount", "voltmeter-swapped", "gauge-swapped"

CHANGES = {
    word: word.replace("-", "_") for word in ("meter-swapped", "reference-swapped", "channel-swapped", REMOUNTED)
}
"""Changes by a person that formulas of any laboratory know, by word: the number of times so far."""

_GAIN, _ZERO_PSI, _WIDER = 2e-5, 1e-4, 3.0
_SPREAD = 0.3
"""Size of an instrument's error in another instrument of its kind, as a fraction: mean 0, this standard deviation."""


@dataclass(frozen=True)
class PersonTruth:
    """The person at the bench of a dry run: `[person]`.

    Attributes:
        comes: whether a person comes when a step by hand is asked for.
        after_s: time until the step is done.
        states: number that the person states if one is asked for; without it the middle of the accepted range, or 0
            if there is no range.
        sets_s: time until a factor is set, when that is asked for.
        reads_s: time until a reading is typed, when that is asked for.
    """

    comes: bool = field(default=True, metadata=accepts(Switch()))
    after_s: float = quantity(600.0, 1.0, 1e6)
    states: float | None = field(default=None, metadata=accepts(Number(-1e9, 1e9)))
    sets_s: float = quantity(30.0, 0.1, 1e6)
    reads_s: float = quantity(15.0, 0.1, 1e6)


@dataclass(frozen=True)
class VoltmeterTruth:
    """Errors of the voltmeter that reads the sensors, beyond the digits of its twin: `[voltmeter]`.

    Attributes:
        gain_ppm: error of its gain.
        square_ppm_per_V: its reading has this error, which grows with the voltage.
        spread_ppm: standard deviation of the gain error of another voltmeter.
    """

    gain_ppm: float = quantity(0.0, -1e5, 1e5)
    square_ppm_per_V: float = quantity(0.0, -1e5, 1e5)
    spread_ppm: float = quantity(15.0, 0.0, 1e5)

    def reads_V(self, volts: float) -> float:
        """Reading of a voltage, volts."""
        return volts * (1.0 + (self.gain_ppm + self.square_ppm_per_V * volts) * 1e-6)


class Drawn:
    """Draws what another part is like.

    Args:
        seed: key of all noise.
    """

    def __init__(self, seed: int) -> None:
        self._seed = seed
        self._count: Counter[str] = Counter()

    def another(self, change: str) -> None:
        """Count a change: draws after it belong to the new part."""
        self._count[change] += 1

    def normal(self, change: str, what: str) -> float:
        """A standard normal number for a property of the present part."""
        return normal(self._seed, f"by hand {change} {what}", self._count[change])

    def share(self, change: str, what: str) -> float:
        """Size of an error of the present part, as a fraction of the first one's."""
        return _SPREAD * self.normal(change, what)

    def voltmeter(self, first: VoltmeterTruth) -> VoltmeterTruth:
        """The present voltmeter, which is not the first one."""
        gain = first.spread_ppm * self.normal(OTHER_VOLTMETER, "gain")
        square = first.square_ppm_per_V * self.share(OTHER_VOLTMETER, "square")
        return replace(first, gain_ppm=gain, square_ppm_per_V=square)

    def gauge(self) -> tuple[float, float]:
        """Gain, and offset in psi, of the present pressure gauge relative to the first one."""
        return 1.0 + _GAIN * self.normal(OTHER_GAUGE, "gain"), _ZERO_PSI * self.normal(OTHER_GAUGE, "zero")


def changed(effects: Effects, change: str, drawn: Drawn) -> Effects:
    """The undeclared effects of a pressure bench after a change."""
    match change:
        case "gauge-swapped":
            gauge = effects.reference_nonlinearity
            size = gauge.upsi_per_psi3 * drawn.share(change, "nonlinearity")
            return replace(effects, reference_nonlinearity=replace(gauge, upsi_per_psi3=size))
        case "line-swapped":
            line = effects.thermal_transpiration
            return replace(effects, thermal_transpiration=replace(line, bore_mm=_WIDER * line.bore_mm))
        case "voltmeter-swapped":  # with its supply of the bridges
            supply, drift = effects.excitation_temperature, effects.excitation_drift
            ppm = supply.ppm_per_sse_degC * drawn.share(change, "supply")
            return replace(
                effects,
                excitation_temperature=replace(supply, ppm_per_sse_degC=ppm),
                excitation_drift=replace(drift, ppm_per_h=_times(drift.ppm_per_h, drawn.share(change, "drift"))),
            )
    return effects


def _times(values: BySensor, factor: float) -> BySensor:
    """A number by sensor, times a factor."""
    if isinstance(values, int | float):
        return values * factor
    return {name: value * factor for name, value in values.items()}
