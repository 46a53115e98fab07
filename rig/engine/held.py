"""Hard-to-change factors that are no temperatures: what an instrument holds while a whole plot lasts.

A source or a pressure controller holds its setting, as an axis that no point moves. Every whole plot is a setting of
its own: a value that stands already is left first. What a person sets is in `set_by_hand`.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping

from drivers.roles import PressureController, Source
from procedures.column_names import spelled, unit_of
from procedures.run_list import Factor, Point, RunList, Settle
from rig.bench import Bench
from rig.engine.motion import Leg
from rig.quantities import TEMPERATURE_UNIT


def held_factors(bench: Bench, run_list: RunList) -> tuple[Factor, ...]:
    """Hard factors that an instrument sets and that do not soak."""
    setters = ((f, bench.instruments.get(bench.config.factors.get(f.name, ""))) for f in run_list.hard)
    return tuple(
        factor
        for factor, setter in setters
        if isinstance(setter, PressureController | Source) and unit_of(factor.name) != TEMPERATURE_UNIT
    )


class Held:
    """What instruments hold for whole plots.

    Args:
        bench: opened instruments.
        run_list: every point.
        settled: criterion of the arrival of an axis.

    Attributes:
        factors: the factors; empty if there are none.
        settled: as given.
    """

    def __init__(self, bench: Bench, run_list: RunList, settled: Callable[[str], Settle]) -> None:
        self.factors, self.settled = held_factors(bench, run_list), settled
        self._run_list = run_list

    def targets(self, point: Point) -> dict[str, float]:
        """Setting by axis in a point's whole plot."""
        setting = self._run_list.setting(point)
        return {f.axis: setting[f.name] for f in self.factors}

    def legs(self, point: Point, now: Mapping[str, float]) -> list[Leg]:
        """Legs to the settings of a point's whole plot; what stands there already is left first, by its overtravel."""
        targets, away = self.targets(point), {}
        for f in self.factors:
            levels, target = self._run_list.levels(f), targets[f.axis]
            if f.overtravel and abs(now[f.axis] - target) < f.overtravel / 2.0:
                upwards = target <= (min(levels) + max(levels)) / 2.0
                away[f.axis] = target + (f.overtravel if upwards else -f.overtravel)
        return [leg for leg in (away, targets) if leg]

    def out_of_place(self, point: Point, values: Mapping[str, float], controlled: Collection[str]) -> str:
        """Why the settings of a point's whole plot do not stand any more; "" if they do.

        Args:
            point: of the whole plot.
            values: readback by axis.
            controlled: axes that are under control.
        """
        for f, target in zip(self.factors, self.targets(point).values(), strict=True):
            if f.axis not in controlled:
                return f"{f.axis} is not controlled"
            if abs(values[f.axis] - target) > self.settled(f.axis).band:
                return f"{f.axis} is at {values[f.axis]:g}, not at {target:g} {spelled(unit_of(f.name))}"
        return ""
