"""Consistency of accepted observations with their points: readbacks, references, settling, approach, chambers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import inf
from typing import Any

from rig.procedures.column_names import spelled, unit_of
from rig.procedures.plan.conduct import EnvironmentSettings, SoakSettings
from rig.procedures.plan.run_list import Factor, Point
from rig.run_file.bodies import Arrivals
from rig.run_file.chain import Record
from rig.run_file.events.bench import EnvironmentSettled
from rig.run_file.events.event import Event
from rig.run_file.events.points import Observed, WholePlotBegan
from rig.run_file.state.state import RunState
from rig.run_file.verify.sense.recorded_run import RecordedRun

_NEAREST = 0.5
"""Smallest fraction of its overtravel that an axis must cover; the controller requires more."""
_SETPOINT_STANDS = 0.1
"""Tolerance of setpoints, degrees Celsius: a chamber rounds to tenths or hundredths. The controller requires less."""
_ROUNDED_S = 0.002
"""Tolerance of settling times, seconds: they are written to the millisecond."""
_ROUNDING = 1e-9


class Places:
    """Checks accepted observations and soaks of whole plots.

    Args:
        case: the run.

    """

    def __init__(self, case: RecordedRun) -> None:
        self._case = case
        self._conduct = case.conduct
        self._chambers = {} if case.bench is None else dict(case.bench.factors)
        self._waited_for: set[str] = set()

    def look(self, record: Record, event: Event, _fold: RunState) -> Iterator[str]:
        """Defects of a record: ends of sentences that begin with the record's name."""
        match event:
            case Observed(accepted=True):
                assert record.run_index is not None
                yield from self._observed(self._case.run_list.points[record.run_index], event)
            case WholePlotBegan():
                yield from self._soak(event)
            case EnvironmentSettled():
                yield from self._chambers_settled(event.chambers)

    def _observed(self, point: Point, event: Observed) -> Iterator[str]:
        for factor, target, side in zip(self._case.run_list.factors, point.setpoints, point.sides, strict=True):
            if not factor.hard:
                yield from self._axis(factor, target, side, event)
        if self._case.soak is not None:
            yield from self._whole_plot(point, event, self._case.soak)
        else:
            yield from self._environment(event, self._case.environment)

    def _axis(self, factor: Factor, target: float, side: int, event: Observed) -> Iterator[str]:
        if self._conduct is None:
            return
        settle, by_hand = self._conduct.settled(factor.axis), factor.name in self._case.by_hand
        most = self._conduct.tolerances.get(factor.name, settle.band) if by_hand else settle.band
        band, name, unit = most + _ROUNDING, factor.name, spelled(unit_of(factor.name))
        within = f"not within {most:g} of its setpoint {target:g} {unit}"
        back = event.readback.get(name)
        if back is None:
            yield f"it has no readback of {name}"
        elif not abs(back - target) <= band:
            yield f"readback of {name} is {back:g}, {within}"
        reference = event.references.get(name)
        if not factor.stays and (reference is None or not abs(reference["mean"] - target) <= band):
            yield f"{name} read {'nothing' if reference is None else format(reference['mean'], 'g')}, {within}"
        yield from self._came(factor, target, side, event.approach)
        if by_hand:
            return
        settled = event.settling.get(factor.axis)
        if settled is None or settled["outcome"] != "settled":
            yield f"{factor.axis} had not settled"
            return
        if settled["seconds"] < settle.dwell_s - _ROUNDED_S:
            yield f"{factor.axis} settled within {settled['seconds']:g} s, less than its dwell"
        if not abs(settled["samples"][-1][1] - target) <= band:
            yield f"{factor.axis} settled at {settled['samples'][-1][1]:g}, {within}"

    def _came(self, factor: Factor, target: float, side: int, approach: Arrivals) -> Iterator[str]:
        """Check the side of approach."""
        came, start = approach.get(factor.axis, (0, target))
        if side and came != side:
            yield f"{factor.axis} did not come from the side that its point asks for"
        elif side and side * (target - start) < _NEAREST * factor.overtravel:
            unit = spelled(unit_of(factor.name))
            yield f"{factor.axis} came from {start:g}, not from beyond its overtravel of {factor.overtravel:g} {unit}"

    def _whole_plot(self, point: Point, event: Observed, soak: SoakSettings) -> Iterator[str]:
        for hard, target in self._hard(point):
            factor = hard.name
            if not self._case.soaks(hard):
                yield from self._held(hard, target, event)
                continue
            chamber = self._chambers.get(factor, "")
            state = event.environment.get(chamber)
            if state is None:
                yield f"it does not say at what temperature {chamber} was"
                continue
            yield from _stood(chamber, state, target, soak.tolerance_degC)
            for name in self._thermometers(factor):
                seen = event.temperatures.get(name)
                if seen is not None and not abs(seen["mean"] - target) <= soak.sensor_tolerance_degC + _ROUNDING:
                    yield f"{name} is {seen['mean']:.2f}, not within {soak.sensor_tolerance_degC:g} of {target:g}"

    def _thermometers(self, factor: str) -> tuple[str, ...]:
        """Those that a soak waited for: of the factor's name, or also others with it as their place."""
        every = () if self._case.bench is None else self._case.bench.thermometers(factor)
        return tuple(name for name in every if name == factor or name in self._waited_for)

    def _held(self, factor: Factor, target: float, event: Observed) -> Iterator[str]:
        """Check a hard factor that is no temperature: its readback, or the value that a person stated."""
        if self._conduct is None:
            return
        name, most = factor.name, self._conduct.settled(factor.axis).band
        stated = event.references.get(name)
        found = event.readback.get(name)
        if name in self._case.by_hand:
            most = self._conduct.tolerances.get(name, most)
            found = target if stated is None else stated["mean"]
        if found is None or not abs(found - target) <= most + _ROUNDING:
            read = "nothing" if found is None else f"{found:g}"
            yield f"{name} was {read}, not within {most:g} of its setpoint {target:g}"

    def _environment(self, event: Observed, wanted: EnvironmentSettings | None) -> Iterator[str]:
        marked = "temperature" in event.flags
        out = (
            []
            if wanted is None
            else [
                f"{name} was at {state['temperature_degC']:.2f} degC, not within {wanted.tolerance_degC:g} of "
                f"{wanted.setpoint_degC:g}"
                for name, state in event.environment.items()
                if not abs(state["temperature_degC"] - wanted.setpoint_degC) <= wanted.tolerance_degC + _ROUNDING
            ]
        )
        if out and not marked:
            yield f"{out[0]}, and it is not marked"
        elif marked and not out:
            yield "it is marked for its temperature, and that is as asked for"

    def _hard(self, point: Point) -> Iterator[tuple[Factor, float]]:
        for factor, target in zip(self._case.run_list.factors, point.setpoints, strict=True):
            if factor.hard:
                yield factor, target

    def _soak(self, event: WholePlotBegan) -> Iterator[str]:
        """Check that a whole plot begins at its place in the run list."""
        soak = self._case.soak
        if soak is None:
            return
        try:
            first, _ = self._case.run_list.points.span(event.planned)
        except KeyError:
            yield f"it begins whole plot {event.planned}, which is not planned"
            return
        self._waited_for |= event.settling.keys()
        point = self._case.run_list.points[first]
        sides = dict(zip(self._case.run_list.factors, point.sides, strict=True))
        for factor, target in self._hard(point):
            if not self._case.soaks(factor):
                if factor.name not in self._case.by_hand:
                    yield from self._came(factor, target, sides[factor], event.approach)
                if abs(event.settings.get(factor.name, inf) - target) > _ROUNDING:
                    yield f"{factor.name} was not set to {target:g}, as the plan has for whole plot {event.planned}"
                continue
            chamber = self._chambers.get(factor.name, "")
            set_to = event.setpoints_degC.get(chamber)
            if set_to is None or abs(set_to - target) > _ROUNDING:
                yield f"{chamber} was set to {set_to}, the plan has {target:g} degC for whole plot {event.planned}"
            within = {chamber: soak.tolerance_degC}
            within |= dict.fromkeys(self._thermometers(factor.name), soak.sensor_tolerance_degC)
            for name, tolerance in within.items():
                settled = event.settling.get(name)
                if settled is not None:
                    yield from _settled(name, settled, target, tolerance)

    def _chambers_settled(self, chambers: Mapping[str, Any]) -> Iterator[str]:
        """Check that the environment had settled as requested before the first point."""
        wanted = self._case.environment
        if wanted is not None:
            for name, settled in chambers.items():
                yield from _settled(name, settled, wanted.setpoint_degC, wanted.tolerance_degC)


def _settled(name: str, settled: Mapping[str, Any], target: float, tolerance: float) -> Iterator[str]:
    last = settled["samples"][-1][1]
    if settled["outcome"] != "settled" or not abs(last - target) <= tolerance + _ROUNDING:
        yield f"{name} had not settled at {target:g} degC: {settled['outcome']}, {last:g}"


def _stood(chamber: str, state: Mapping[str, Any], target: float, tolerance: float) -> Iterator[str]:
    if not state["running"]:
        yield f"{chamber} was not controlling"
    if abs(state["setpoint_degC"] - target) > _SETPOINT_STANDS:
        yield f"{chamber} was set to {state['setpoint_degC']:g} degC, the plan has {target:g}"
    if not abs(state["temperature_degC"] - target) <= tolerance + _ROUNDING:
        yield f"{chamber} was at {state['temperature_degC']:.2f} degC, not within {tolerance:g} of {target:g}"
