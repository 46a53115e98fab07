"""The guard: limits and interlocks, checked outside the plan.

Limits are data (`[limits]` of the bench file). They are checked on the whole run list before anything moves, again
at every command, and against every readback.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from drivers.roles import ChamberState
from procedures import RunList
from rig.engine.axes import AxisReading
from rig.errors import BenchFault, ConfigurationError

_READBACK_MARGIN = 0.05
"""A readback may pass a limit by this much, degrees or psi, while an axis rests against it."""

_CHAMBER_MARGIN_DEGC = 2.0
"""The same of a chamber, which overshoots a setpoint at a limit before it settles there."""


class Guard:
    """Refuses what the bench file forbids.

    Args:
        limits: (low, high) by quantity, named with its unit: "pitch_deg", "enclosure_degC".
        factors: which instrument sets a factor; a chamber's limits are those of the temperature it sets.

    """

    def __init__(
        self, limits: Mapping[str, tuple[float, float]], factors: Mapping[str, str] = MappingProxyType({})
    ) -> None:
        of_chambers = {f: limits[f"{name}_degC"] for f, name in factors.items() if f"{name}_degC" in limits}
        self._limits = {**of_chambers, **limits}

    @property
    def limits(self) -> Mapping[str, tuple[float, float]]:
        """(low, high) by quantity, factors included."""
        return self._limits

    def check_run_list(self, run_list: RunList, instrument: Mapping[str, tuple[float, float]]) -> None:
        """Refuse a run list that would leave the bench's limits or the instrument's own travel.

        Args:
            run_list: every point of the run.
            instrument: the instruments' own (low, high) by factor name.

        Raises:
            ConfigurationError: with one line for every factor that leaves them.

        """
        problems = [
            f"{sentence} ({whose})"
            for limits, whose in ((self._limits, "bench limits"), (instrument, "the instrument's own limits"))
            for sentence in run_list.beyond(limits)
        ]
        if problems:
            raise ConfigurationError(
                "the design leaves the limits; nothing was moved:\n" + "\n".join(f"  {p}" for p in problems)
            )

    def check_environment(self, setpoint_degC: float, chambers: Mapping[str, tuple[float, float]]) -> None:
        """Refuse an environment outside the bench's limits or a chamber's own range.

        Args:
            setpoint_degC: what the procedure asks of every chamber.
            chambers: each chamber's own (low, high) by name.

        Raises:
            ConfigurationError: naming the chamber.

        """
        for name, span in chambers.items():
            limits = self._limits.get(f"{name}_degC", span)
            for (low, high), whose in ((limits, "bench limits"), (span, "the chamber's own range")):
                if not low <= setpoint_degC <= high:
                    raise ConfigurationError(
                        f"environment.setpoint_degC = {setpoint_degC:g} is outside {low:g} to {high:g} "
                        f"({whose} of {name}); nothing was commanded"
                    )

    def check_command(self, quantity: str, value: float) -> None:
        """Refuse one command outside the limits. Raises `BenchFault`."""
        low, high = self._limits.get(quantity, (float("-inf"), float("inf")))
        if not low <= value <= high:
            raise BenchFault(f"{quantity} = {value:g} was about to be commanded, outside {low:g} to {high:g}")

    def check_axes(self, axes: Mapping[str, AxisReading]) -> None:
        """Refuse readbacks outside the limits. Raises `BenchFault`."""
        for axis, reading in axes.items():
            low, high = self._limits.get(reading.quantity, (float("-inf"), float("inf")))
            if not low - _READBACK_MARGIN <= reading.value <= high + _READBACK_MARGIN:
                unit = reading.quantity.rpartition("_")[2]
                raise BenchFault(f"{axis} is at {reading.value:g} {unit}, outside {low:g} to {high:g}")

    def check_chamber(self, name: str, state: ChamberState) -> None:
        """Refuse alarms and temperatures outside the limits. Raises `BenchFault`."""
        if state.alarms:
            raise BenchFault(f"{name} reports an alarm: {', '.join(state.alarms)}; look at the chamber, then resume")
        low, high = self._limits.get(f"{name}_degC", (float("-inf"), float("inf")))
        if not low - _CHAMBER_MARGIN_DEGC <= state.temperature_degC <= high + _CHAMBER_MARGIN_DEGC:
            raise BenchFault(
                f"{name} is at {state.temperature_degC:.2f} degC, outside {low:g} to {high:g}; look at the chamber, "
                f"then resume"
            )
