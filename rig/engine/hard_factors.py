"""Hard-to-change factors that are no temperatures: what an instrument holds while a whole plot lasts.

A source, a pressure controller or an axis of a head holds its setting, as an axis that no point moves. Every whole plot
is a setting of its own: a value that stands already is left first. An angle comes from its planned side. What a person
sets is in `by_hand.to_set`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from rig.drivers.roles import Head, PressureController, Source
from rig.engine.motion import NEARLY, Arrival, Leg
from rig.instruments.opening import Bench
from rig.procedures.column_names import spelled, unit_of
from rig.procedures.plan.run_list import Factor, Point, RunList, Settle
from rig.units.of_instruments import HEAD_AXES, TEMPERATURE_UNIT


def held_factors(bench: Bench, run_list: RunList) -> tuple[Factor, ...]:
    """Hard factors that an instrument sets and that do not soak."""
    setters = ((f, bench.instruments.get(bench.config.factors.get(f.name, ""))) for f in run_list.hard)
    return tuple(
        factor
        for factor, setter in setters
        if of_head(bench, factor)
        or (isinstance(setter, PressureController | Source) and unit_of(factor.name) != TEMPERATURE_UNIT)
    )


def of_head(bench: Bench, factor: Factor) -> bool:
    """Whether a factor is an angle of the head, which needs no entry under `[factors]`."""
    name = bench.config.factors.get(factor.name)
    return factor.axis in HEAD_AXES and (name is None or isinstance(bench.instruments[name], Head))


class HardFactors:
    """What instruments hold for whole plots.

    Args:
        bench: opened instruments.
        run_list: every point.
        settled: criterion of the arrival of an axis.

    Attributes:
        factors: the factors; empty if there are none.
        settled: as given.
        by_head: whether one of them is an angle of the head, which homing moves.
    """

    def __init__(self, bench: Bench, run_list: RunList, settled: Callable[[str], Settle]) -> None:
        self.factors, self.settled = held_factors(bench, run_list), settled
        self.by_head = any(of_head(bench, f) for f in self.factors)
        self._run_list = run_list

    def targets(self, point: Point) -> dict[str, float]:
        """Setting by axis in a point's whole plot."""
        setting = self._run_list.setting(point)
        return {f.axis: setting[f.name] for f in self.factors}

    def legs(self, point: Point, now: Mapping[str, float]) -> list[Leg]:
        """Legs to the settings of a point's whole plot, each from its planned side.

        What has no such side, and stands there already, is left first by its overtravel.
        """
        targets, sides, away = self.targets(point), self.sides(point), {}
        for f in self.factors:
            target, side = targets[f.axis], sides[f.axis]
            if side and side * (target - now[f.axis]) < f.overtravel:
                away[f.axis] = target - side * f.overtravel
            elif not side and abs(now[f.axis] - target) < f.overtravel / 2.0:
                levels = self._run_list.levels(f)
                upwards = target <= (min(levels) + max(levels)) / 2.0
                away[f.axis] = target + (f.overtravel if upwards else -f.overtravel)
        return [leg for leg in (away, targets) if leg]

    def sides(self, point: Point) -> dict[str, int]:
        """Planned side of approach by axis: 1 upwards, -1 downwards, 0 for any."""
        planned = zip(self._run_list.factors, point.sides, strict=True)
        return {f.axis: side for f, side in planned if f in self.factors}

    def astray(self, point: Point, arrivals: Mapping[str, Arrival]) -> str:
        """What did not come from its planned side, or from too near; "" if all did."""
        targets, sides = self.targets(point), self.sides(point)
        for f in self.factors:
            side, came = sides[f.axis], arrivals.get(f.axis)
            if side and (
                came is None or came.side != side or side * (targets[f.axis] - came.start) < NEARLY * f.overtravel
            ):
                return f"{f.axis} did not arrive from its planned side"
        return ""

    def out_of_place(self, point: Point, values: Mapping[str, tuple[float, bool]]) -> str:
        """Why the settings of a point's whole plot do not stand any more; "" if they do.

        Args:
            point: of the whole plot.
            values: by axis, its readback, and whether it is under control and its zero is known.
        """
        for f, target in zip(self.factors, self.targets(point).values(), strict=True):
            value, controlled = values[f.axis]
            if not controlled:
                return f"{f.axis} is not controlled"
            if abs(value - target) > self.settled(f.axis).band:
                return f"{f.axis} is at {value:g}, not at {target:g} {spelled(unit_of(f.name))}"
        return ""
