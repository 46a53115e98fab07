"""The guard: limits and interlocks, checked outside the plan.

Limits are data (`[limits]` of the bench file). They are checked on the whole run list before anything moves, again
at every command, and against every readback.
"""

from __future__ import annotations

from collections.abc import Mapping

from drivers.roles import AxisState, ChamberState
from procedures import RunList
from rig.errors import BenchFault, ConfigurationError

_READBACK_MARGIN_DEG = 0.05
"""A readback may pass a limit by this much while an axis rests against it."""


class Guard:
    """Refuses what the bench file forbids.

    Args:
        limits: (low, high) by quantity, named with its unit: "pitch_deg", "enclosure_degC".

    """

    def __init__(self, limits: Mapping[str, tuple[float, float]]) -> None:
        self._limits = dict(limits)

    def check_run_list(self, run_list: RunList, instrument: Mapping[str, tuple[float, float]]) -> None:
        """Refuse a run list that would leave the bench's limits or the instrument's own travel.

        Args:
            run_list: every point of the run.
            instrument: the head's own (low, high) by axis.

        Raises:
            ConfigurationError: with one line for every factor that leaves them.

        """
        travel = {f"{axis}_deg": span for axis, span in instrument.items()}
        problems = [
            f"{sentence} ({whose})"
            for limits, whose in ((self._limits, "bench limits"), (travel, "the head's own limits"))
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

    def check_axes(self, axes: Mapping[str, AxisState]) -> None:
        """Refuse readbacks outside the limits, and drives that report a fault. Raises `BenchFault`."""
        for axis, state in axes.items():
            low, high = self._limits.get(f"{axis}_deg", (float("-inf"), float("inf")))
            if not low - _READBACK_MARGIN_DEG <= state.position_deg <= high + _READBACK_MARGIN_DEG:
                raise BenchFault(f"{axis} is at {state.position_deg:g} deg, outside {low:g} to {high:g}")

    def check_chamber(self, name: str, state: ChamberState) -> None:
        """Refuse alarms and temperatures outside the limits. Raises `BenchFault`."""
        if state.alarms:
            raise BenchFault(f"{name} reports an alarm: {', '.join(state.alarms)}; look at the chamber, then resume")
        low, high = self._limits.get(f"{name}_degC", (float("-inf"), float("inf")))
        if not low <= state.temperature_degC <= high:
            raise BenchFault(f"{name} is at {state.temperature_degC:.2f} degC, outside {low:g} to {high:g}")
