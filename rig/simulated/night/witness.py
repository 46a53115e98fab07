"""What truly happened in a night, seen from the physics: no driver, no protocol and no run file has a say in it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from rig.simulated.dry_run import DryBench


@dataclass(frozen=True, slots=True)
class Seen:
    """One reading that a meter truly took.

    Attributes:
        t_s: world time at the middle of its integration.
        input: what was at its input, V or degrees Celsius, before the meter added anything of its own.
        setting: where every easy factor truly was, by axis.
        direction: from which side it had come there, 1 or -1; 0 where nobody can say.
        whole_plot: number of the stay at a pair of temperatures, as the transducers count them; 0 without chambers.
        air_degC: of every chamber.

    """

    t_s: float
    input: float
    setting: Mapping[str, float]
    direction: Mapping[str, int]
    whole_plot: int
    air_degC: Mapping[str, float]


class _State(NamedTuple):
    """Where everything truly is; see `Seen`."""

    setting: Mapping[str, float]
    direction: Mapping[str, int]
    whole_plot: int
    air_degC: Mapping[str, float]


@dataclass
class Witness:
    """Looks over the meters' shoulders, and at what is commanded, as it takes effect.

    Args:
        bench: the simulated bench.

    Attributes:
        readings: by instrument and channel, in order of time.
        vents: world times at which the line was told to vent.
        extremes: lowest and highest value that anything was told to go to, by quantity as the bench's limits name it.

    """

    bench: DryBench
    readings: dict[tuple[str, str], list[Seen]] = field(default_factory=dict)
    extremes: dict[str, tuple[float, float]] = field(default_factory=dict)
    vents: list[float] = field(default_factory=list)

    def __post_init__(self) -> None:
        plant = self.bench.sim.plant
        volts, degrees = plant.channel_V, plant.channel_degC
        factors = self.bench.config.factors
        first = next(iter(self.bench.config.sensors.values()))
        self._first, self._state = (first.reader, first.channel), _State({}, {}, 0, {})
        self._line = plant.stand.line(factors["pressure_psia"]) if "pressure_psia" in factors else None
        instruments = self.bench.config.instruments.items()
        self._chambers = {name: plant.chamber(name) for name, one in instruments if one.driver == "watlow-f4t"}

        def channel_V(instrument: str, channel: str, t0: float, t1: float) -> float:  # noqa: N802
            value = volts(instrument, channel, t0, t1)
            self._note(instrument, channel, (t0 + t1) / 2.0, value)
            return value

        def channel_degC(instrument: str, channel: str, t: float) -> float:  # noqa: N802
            value = degrees(instrument, channel, t)
            self._note(instrument, channel, t, value)
            return value

        plant.channel_V = channel_V  # type: ignore[method-assign]
        plant.channel_degC = channel_degC  # type: ignore[method-assign]
        self._watch_commands()

    def _note(self, instrument: str, channel: str, t: float, value: float) -> None:
        if (instrument, channel) == self._first:  # a sweep takes seconds, in which nothing moves
            self._state = self._now(t)
        state = self._state
        seen = Seen(t, value, state.setting, state.direction, state.whole_plot, state.air_degC)
        self.readings.setdefault((instrument, channel), []).append(seen)

    def _now(self, t: float) -> _State:
        plant = self.bench.sim.plant
        if self._line is not None:
            return _State(
                {"pressure": self._line.pressure_psia(t)},
                {"pressure": self._line.settings.direction(t)},
                plant.stand.conditions(t - 1e-3, t + 1e-3).whole_plot,
                {name: chamber.air_degC(t) for name, chamber in self._chambers.items()},
            )
        axes = plant.head.axes
        return _State(
            {name: axis.true_deg(t) for name, axis in axes.items()},
            {name: round(axis.leg(t).course.direction) for name, axis in axes.items()},
            0,
            {},
        )

    def _watch_commands(self) -> None:
        head, line = self.bench.sim.plant.head, self._line
        move = head.move

        def watched_move(axis: str, target_deg: float, speed: float, accel: float) -> None:
            self._extend(f"{axis}_deg", target_deg)
            move(axis, target_deg, speed, accel)

        head.move = watched_move  # type: ignore[method-assign]
        for name, chamber in self._chambers.items():
            self._watch_setpoint(name, chamber)
        if line is not None:
            command = line.command

            def watched_command(
                now: float, setpoint_psia: float, slew_psi_per_s: float, *, overshoot: bool = False
            ) -> None:
                self._extend("pressure_psia", setpoint_psia)
                command(now, setpoint_psia, slew_psi_per_s, overshoot=overshoot)

            line.command = watched_command  # type: ignore[method-assign]
            vent = line.vent

            def watched_vent(now: float, rate_psi_per_s: float) -> None:
                self.vents.append(now)
                vent(now, rate_psi_per_s)

            line.vent = watched_vent  # type: ignore[method-assign]

    def _watch_setpoint(self, name: str, chamber: Any) -> None:
        told = chamber.command

        def watched(*arguments: Any, **options: Any) -> None:
            told(*arguments, **options)
            self._extend(f"{name}_degC", chamber.setpoint_degC)

        chamber.command = watched

    def _extend(self, quantity: str, value: float) -> None:
        low, high = self.extremes.get(quantity, (value, value))
        self.extremes[quantity] = (min(low, value), max(high, value))

    def not_safe(self, *, moving_only: bool) -> list[str]:
        """What on the bench is not safe at this moment, in words.

        Args:
            moving_only: an interrupted session leaves pressure and temperatures as they are, for the next one.

        """
        now, plant = self.bench.world.now(), self.bench.sim.plant
        found = []
        if self._line is None:
            found += [f"{axis} is moving" for axis in plant.head.axes if plant.head.moving(axis, now)]
        if moving_only:
            return found
        if self._line is not None:
            psia = self._line.pressure_psia(now)
            if self._line.controlling or abs(psia - self._line.ambient_psia(now)) > _AT_THE_ATMOSPHERE_PSI:
                found.append(f"the line is at {psia:.2f} psia, {'controlled' if self._line.controlling else 'closed'}")
        for name, chamber in self._chambers.items():
            if not _HARMLESS_DEGC[0] <= chamber.setpoint_degC <= _HARMLESS_DEGC[1]:
                found.append(f"{name} is left at a setpoint of {chamber.setpoint_degC:.1f} degC")
        return found


_AT_THE_ATMOSPHERE_PSI = 0.5
_HARMLESS_DEGC = (15.0, 30.0)
