"""The guard: limits and interlocks, checked outside the plan.

Both are data (`[limits]` and `[interlocks]` of the bench file). Limits are checked on the whole run list before
anything moves, at every command (here before it is sent, and again at the driver by `rig.instruments.guarded`), and at
every readback: the value itself, and its rate of change if the bench limits that.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

from rig.bench.protection import InterlockConfig
from rig.drivers.roles import ChamberState
from rig.engine.axes import CHAMBER_MARGIN_DEGC, AxisReading
from rig.engine.fault_classes import ChamberAlarm, LimitViolation
from rig.engine.interlocks import Interlocks
from rig.errors import ConfigurationError
from rig.procedures.column_names import spelled, unit_of
from rig.procedures.plan.run_list import RunList
from rig.units.of_instruments import PRESSURE

_RATE_MARGIN = 1.25
"""A rate may exceed its limit by this factor: it is the difference of two readings, each with noise and delay."""

_ANY = (float("-inf"), float("inf"))

_RATE_OVER_S = {"psi_per_s": 4.0, "degC_per_min": 120.0}
"""Minimum time between the two readings of a rate, seconds: over less, noise and delay would be a rate. Chosen."""


class Guard:
    """Refuses commands and readbacks that the bench file forbids.

    Args:
        limits: (low, high) by quantity, named with its unit: "enclosure_degC".
        factors: which instrument sets a factor; a chamber's limits are those of the temperature it sets.
        interlocks: further conditions that must hold, by name.
        now: bench time, for rates and durations.

    """

    def __init__(
        self,
        limits: Mapping[str, tuple[float, float]],
        factors: Mapping[str, str] = MappingProxyType({}),
        interlocks: Mapping[str, InterlockConfig] = MappingProxyType({}),
        now: Callable[[], float] = lambda: 0.0,
    ) -> None:
        self._interlocks = Interlocks(interlocks, now)
        self._watched = frozenset({PRESSURE, *(rule.watch for rule in interlocks.values())})
        self._now = now
        self._rated: dict[str, tuple[float, float]] = {}
        of_chambers = {f: limits[f"{name}_degC"] for f, name in factors.items() if f"{name}_degC" in limits}
        of_factors = {f"{name}_degC": limits[f] for f, name in factors.items() if f in limits and f.endswith("_degC")}
        self._limits = {**of_factors, **of_chambers, **limits}

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
            ConfigurationError: with one line for every factor that leaves its limits.

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
        """Refuse one command outside the limits. Raises `LimitViolation`."""
        low, high = self._limits.get(quantity, (float("-inf"), float("inf")))
        if not low <= value <= high:
            raise LimitViolation(f"{quantity} = {value:g} was about to be commanded, outside {low:g} to {high:g}")

    def check_axes(self, axes: Mapping[str, AxisReading]) -> None:
        """Refuse readbacks that violate a limit or an interlock. Raises `LimitViolation`, `InterlockHold`."""
        limits, watched = self._limits, self._watched
        for axis, (quantity, value, _, _, _, _, _, margin) in axes.items():
            low, high = limits.get(quantity, _ANY)
            if not low - margin <= value <= high + margin:
                unit = spelled(unit_of(quantity))
                raise LimitViolation(f"{axis} is at {value:g} {unit}, outside {low:g} to {high:g}")
            if quantity in watched:
                if quantity == PRESSURE:
                    self._check_rate(axis, "pressure_psi_per_s", value)
                self._interlocks.check(quantity, value)

    def check_chamber(self, name: str, state: ChamberState) -> None:
        """Refuse alarms, and temperatures outside the limits. Raises `LimitViolation`, `InterlockHold`."""
        self._interlocks.check_chamber(name, state)
        if state.alarms and not self._interlocks.watches(f"{name}.alarms"):
            alarms = ", ".join(state.alarms)
            raise ChamberAlarm(f"{name} reports an alarm: {alarms}; look at {name}, then resume")
        low, high = self._limits.get(f"{name}_degC", (float("-inf"), float("inf")))
        if not low - CHAMBER_MARGIN_DEGC <= state.temperature_degC <= high + CHAMBER_MARGIN_DEGC:
            raise LimitViolation(
                f"{name} is at {state.temperature_degC:.2f} degC, outside {low:g} to {high:g}; look at {name}, then "
                f"resume"
            )
        self._check_rate(name, f"{name}_degC_per_min", state.temperature_degC)

    def check_temperatures(self, values: Mapping[str, float]) -> None:
        """Check temperature columns against the interlocks. Raises `LimitViolation` or `InterlockHold`."""
        for column, degC in values.items():
            self._interlocks.check(column, degC)

    def _check_rate(self, name: str, limit: str, value: float) -> None:
        """Check the rate of change of a readback, against an earlier one that is old enough."""
        if limit not in self._limits:
            return
        unit = next(u for u in _RATE_OVER_S if limit.endswith(u))
        now = self._now()
        then, before = self._rated.setdefault(limit, (now, value))
        seconds = now - then
        if seconds < _RATE_OVER_S[unit]:
            return
        self._rated[limit] = (now, value)
        if seconds > 10.0 * _RATE_OVER_S[unit]:  # nobody has read in between, and the mean rate says little
            return
        rate = (value - before) / seconds * (60.0 if unit.endswith("min") else 1.0)
        low, high = self._limits[limit]
        if not low * _RATE_MARGIN <= rate <= high * _RATE_MARGIN:
            words = spelled(unit)
            raise LimitViolation(
                f"{name} changes by {rate:.3g} {words}, faster than {low:g} to {high:g} (limits.{limit})"
            )
