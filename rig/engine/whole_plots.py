"""Whole plots: which chambers soak, when a soak is over, and whether an interrupted whole plot may continue.

A chamber that was changed or has drifted has a new draw of the whole-plot error. So a whole plot continues after an
interruption only if nothing indicates that its temperatures changed. Otherwise it is measured again, in full, under
a new identity; earlier readings remain data of the whole plot in which they were made.

`soaking` applies these rules while readings are taken, and has one of its own, for a bench without power
(`Soaking.lost_now`); `prepared_environment` applies them after a gap or a hold. Their settings: the procedure's
`[soak]`, and `continue_gap_s` of `[recovery]`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rig.drivers.roles import is_overload
from rig.engine.hard_factors import held_factors
from rig.engine.measuring import Channel
from rig.engine.readback import HANGS_S, Readback
from rig.engine.settling import SETPOINT_STANDS, Criteria
from rig.errors import BenchFault
from rig.instruments.opening import Bench
from rig.procedures.plan.conduct import WholePlotConduct
from rig.procedures.plan.run_list import Point, RunList

AMBIENT_DEGC = 23.0
"""Temperature towards which a chamber leaves its setpoint, degrees Celsius: chambers reach both sides of it."""

_OPEN_POLLS = 3
"""Consecutive polls out of range after which a thermometer counts as broken or disconnected; one may be a
disturbance."""


def renewal(target_degC: float, away_degC: float) -> float:
    """Setpoint to leave a held temperature before it is set again: towards ambient, degrees Celsius."""
    return target_degC + (away_degC if target_degC < AMBIENT_DEGC else -away_degC)


@dataclass(frozen=True)
class Soaked:
    """One hard-to-change factor.

    Attributes:
        factor: its name.
        chamber: the instrument that sets it.
        thermometers: temperature columns that are recorded in it.

    """

    factor: str
    chamber: str
    thermometers: tuple[str, ...]


class WholePlots:
    """The rules of whole plots on one bench.

    Args:
        bench: opened instruments.
        run_list: every point of the run.
        conduct: soak and recovery.

    Attributes:
        continue_gap_s: a whole plot left alone for longer is not continued, seconds.
        doubted_s: for a whole plot that was just found lost, the seconds before that in which a chamber repeated its
            reading to the last digit, which it never did before. Points accepted in this time are in doubt.

    Raises:
        ConfigurationError: the bench file names no chamber for a factor.

    """

    def __init__(self, bench: Bench, run_list: RunList, conduct: WholePlotConduct) -> None:
        self._run_list = run_list
        self._soak = conduct.soak
        self.continue_gap_s = conduct.continue_gap_s
        others = {f.name for f in held_factors(bench, run_list)} | {
            f.name for f in run_list.hard if bench.by_hand(f.name) is not None
        }
        self.soaked = [
            Soaked(f.name, bench.soaks(f.name)[0], bench.config.thermometers(f.name))
            for f in run_list.hard
            if f.name not in others
        ]
        self._by_hand_only = not self.soaked and all(bench.by_hand(f.name) is not None for f in run_list.hard)
        self.doubted_s = 0.0
        self._open_for: dict[str, int] = {}
        self._readbacks = {s.chamber: Readback() for s in self.soaked if not bench.coarse(s.chamber)}
        self._whole_plot: int | None = None

    def note(self, identity: int | None, chambers: Mapping[str, Any]) -> None:
        """Learn, from an accepted observation of a whole plot, how the chambers' readings change."""
        for name in self._readbacks.keys() & chambers.keys():
            state = chambers[name]
            at, target, stood_s = state["temperature_degC"], state["setpoint_degC"], state.get("stood_s", 0.0)
            self._readbacks[name].note(at, target, stood_s, new_whole_plot=identity != self._whole_plot)
        self._whole_plot = identity

    @property
    def thermometers(self) -> list[str]:
        """Temperature columns that show when a factor has settled at the sensors."""
        return [name for s in self.soaked for name in s.thermometers]

    def targets(self, point: Point) -> dict[str, float]:
        """Chamber name to its setpoint in a point's whole plot, degrees Celsius."""
        setting = self._run_list.setting(point)
        return {s.chamber: setting[s.factor] for s in self.soaked}

    def span(self, whole_plot: int) -> tuple[int, int]:
        """First index and number of points of a planned whole plot."""
        return self._run_list.points.span(whole_plot)

    def criteria(self, point: Point) -> dict[str, Criteria]:
        """Settling criteria for the soak of a point's whole plot, by chamber name and temperature column."""
        s, setting = self._soak, self._run_list.setting(point)
        drift = s.drift_degC_per_h / 3600.0
        found = {}
        for soaked in self.soaked:
            target = setting[soaked.factor]
            found[soaked.chamber] = Criteria(target, s.tolerance_degC, s.dwell_s, drift, s.timeout_s)
            within = Criteria(target, s.sensor_tolerance_degC, s.dwell_s, drift, s.timeout_s)
            found |= dict.fromkeys(soaked.thermometers, within)
        return found

    def left(self, point: Point, chambers: Mapping[str, Any]) -> bool:
        """Whether a chamber is so far from its setpoint for a whole plot that going there is a change of
        temperature.
        """
        half = self._soak.renew_degC / 2.0
        return any(abs(chambers[c]["temperature_degC"] - t) >= half for c, t in self.targets(point).items())

    def renewal(self, point: Point) -> dict[str, float]:
        """Chamber setpoints to visit first if chambers are at their setpoints already: a new draw needs a change."""
        return {c: renewal(t, self._soak.renew_degC) for c, t in self.targets(point).items()}

    def check_chambers(self, point: Point, chambers: Mapping[str, Any]) -> str:
        """Description of a change to a chamber by somebody else during a soak; "" if none."""
        for chamber, target in self.targets(point).items():
            state = chambers[chamber]
            if not state["running"]:
                return f"{chamber} is not controlling any more: was it switched off at its panel, or without power?"
            if abs(state["setpoint_degC"] - target) > SETPOINT_STANDS:
                return f"{chamber} is set to {state['setpoint_degC']:g} degC, not to {target:g} degC as commanded"
        return ""

    def check_thermometers(self, values: Mapping[str, float]) -> None:
        """Give up a soak that no reading can end. Raises `BenchFault` with the name of the thermometer."""
        for name in self.thermometers:
            self._open_for[name] = self._open_for.get(name, 0) + 1 if is_overload(values[name]) else 0
            if self._open_for[name] >= _OPEN_POLLS:
                raise BenchFault(
                    f"{name} reads open or out of range, {_OPEN_POLLS} times in a row: look at that thermometer and "
                    f"its wiring, then resume"
                )

    def lost_meanwhile(
        self,
        point: Point,
        idle_s: float,
        *,
        certain: bool,
        watched: bool,
        restarted: Sequence[str],
        as_found: Mapping[str, Any],
    ) -> str:
        """Why the whole plot of `point` may not continue after an interruption; "" if it may.

        Args:
            point: the next one of that whole plot.
            idle_s: seconds since its last accepted reading, or since its soak ended.
            certain: whether this time was measured by one clock, without a reboot.
            watched: whether this session began the whole plot or worked on it, and was there since then.
            restarted: instruments that have lost power.
            as_found: chambers as found, before any command.

        """
        self.doubted_s = 0.0
        if not certain:  # UTC may have been stepped, so no gap by it proves that the bench stood
            return "the controller's machine was restarted, so it is not known how long the bench was left alone"
        if self._by_hand_only and watched:
            return ""  # what a person has set stays without power, and while the controller waits for somebody
        if idle_s > self.continue_gap_s:
            return f"left alone for {idle_s / 60:.0f} min, longer than continue_gap_s = {self.continue_gap_s:g} s"
        if restarted and not self._by_hand_only:
            return without_power(restarted)
        return self._left(self.targets(point), as_found["chambers"], {})

    def lost_now(self, point: Point, chambers: Mapping[str, Any], temperatures: Mapping[str, Channel]) -> str:
        """Why the last readings do not belong to the whole plot; "" if they do.

        Args:
            point: the point of the readings.
            chambers: states of the chambers right after the readings.
            temperatures: thermometer readings during them, by column.

        """
        return self._left(self.targets(point), chambers, temperatures)

    def out_of_place(self, point: Point, chambers: Mapping[str, Any]) -> str:
        """Which chamber does not hold the whole plot of `point`, and where it is; "" if all do."""
        return self._out_of_place(self.targets(point), chambers, {})

    def _left(
        self, targets: Mapping[str, float], chambers: Mapping[str, Any], temperatures: Mapping[str, Channel]
    ) -> str:
        why = self._out_of_place(targets, chambers, temperatures)
        stood = (self._stood_s(soaked.chamber, chambers[soaked.chamber]) for soaked in self.soaked)
        self.doubted_s = max(stood, default=0.0) if why else 0.0
        return why

    def _stood_s(self, name: str, state: Mapping[str, Any]) -> float:
        """Seconds since a chamber that should move began to repeat a reading; 0 if it may stand, or does not."""
        return float(state.get("unchanged_s", state.get("stood_ago_s", 0.0))) if self._should_move(name) else 0.0

    def _should_move(self, name: str) -> bool:
        return name in self._readbacks and self._readbacks[name].should_move

    def _out_of_place(
        self, targets: Mapping[str, float], chambers: Mapping[str, Any], temperatures: Mapping[str, Channel]
    ) -> str:
        for soaked in self.soaked:
            name, target, state = soaked.chamber, targets[soaked.chamber], chambers[soaked.chamber]
            if not state["running"]:
                return f"{name} is not controlling"
            if abs(state["setpoint_degC"] - target) > SETPOINT_STANDS:
                return f"{name} is set to {state['setpoint_degC']:g} degC, not to {target:g} degC"
            if abs(state["temperature_degC"] - target) > self._soak.tolerance_degC:
                return f"{name} is at {state['temperature_degC']:.2f} degC, not at {target:g} degC"
            still_s = state.get("unchanged_s", 0.0)
            if still_s >= HANGS_S and self._should_move(name):
                return f"{name} hangs: it has read {state['temperature_degC']:g} degC for {still_s:.0f} s"
            for thermometer in soaked.thermometers:
                seen = temperatures.get(thermometer)
                if seen is not None and abs(seen.mean - target) > self._soak.sensor_tolerance_degC:
                    return f"{thermometer} is {seen.mean:.2f} degC, not {target:g} degC"
        return ""


def without_power(restarted: Sequence[str]) -> str:
    """Why a whole plot is lost if these instruments lost power, whether at work or in a gap."""
    return f"{' and '.join(restarted)} had no power meanwhile"
