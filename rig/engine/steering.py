"""Bringing a quantity to its level: the controller sets, reads the standard, and corrects.

Settings are corrected by secants, in the planned direction of approach. A setting that went beyond its level is
approached again from the planned side, from beyond its overtravel, and the observation is flagged.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rig.engine.actions import BenchActions
from rig.engine.fault_classes import NotSettled
from rig.engine.motion import Arrival
from rig.engine.steered import Steered
from rig.procedures.column_names import spelled, unit_of
from rig.procedures.plan.conduct import Conduct
from rig.procedures.plan.run_list import Factor, Point
from rig.run_file.events.points import OVERSHOT

TRIES = 8
"""Settings of one level, at most; chosen."""
_AIM = 0.5
"""Part of what is allowed by which a correction stays short of the level: the next one must not come from beyond."""
_SAME = 1e-9
"""Relative difference below which a corrected setting is the one before: the source is at the end of its range."""


class Steering:
    """Brings quantities to their levels.

    Args:
        do: actions on the bench.
        conduct: how near a level has to come, and how a setting settles.
        steered: the quantities.
    """

    def __init__(self, do: BenchActions, conduct: Conduct, steered: Sequence[Steered]) -> None:
        self._do, self._conduct, self._steered = do, conduct, {one.factor.name: one for one in steered}

    def bring(self, point: Point, factors: Sequence[Factor], targets: dict[str, float]) -> dict[str, Any]:
        """Correct the settings of a point until the standards read their levels.

        Args:
            point: the point.
            factors: of its setpoints.
            targets: of every axis.

        Returns:
            By quantity, the settings that were tried and what the standard read at each, in order.

        Raises:
            NotSettled: a level cannot be reached.
        """
        found = {}
        for factor, side in zip(factors, point.sides, strict=True):
            if factor.name in self._steered:
                found[factor.name] = self._one(self._steered[factor.name], targets, side)
        return found

    def _one(self, steered: Steered, targets: dict[str, float], side: int) -> dict[str, Any]:
        factor, level = steered.factor, targets[steered.factor.axis]
        near, tries, overshot = self._conduct.near[factor.name], list[tuple[float, float]](), False
        while True:
            setting = steered.setting(level)
            tries.append((setting, self._do.sweeps.standard(factor.name, self._conduct.readings)))
            steered.learn(*tries[-1])
            off = tries[-1][1] - level
            if abs(off) <= near:
                told = {"of": steered.own.name, "tries": [list(one) for one in tries]}
                return told | ({OVERSHOT: True} if overshot else {})
            low, high = steered.limits()
            wanted = _next(tries, level - side * _AIM * near, steered.slope(setting))
            corrected = min(max(wanted, low), high)
            if len(tries) == TRIES or abs(corrected - setting) <= _SAME * (abs(setting) or 1.0):
                raise NotSettled(_not_reached(steered, level, near, tries, wanted, (low, high)), {"tries": tries})
            beyond = side * off > 0.0
            overshot |= beyond
            self._again(steered, targets, side if beyond else 0, corrected)

    def _again(self, steered: Steered, targets: dict[str, float], side: int, setting: float) -> None:
        """Set once more; from beyond its overtravel, if a side is given. Its first move to the level stays the move."""
        axis, level = steered.factor.axis, targets[steered.factor.axis]
        came, move = self._do.arrivals.get(axis), self._do.moves.get(axis)
        steered.correct(level, setting)
        back = [{axis: level - side * steered.factor.overtravel}] if side else []
        self._do.go([*back, {axis: level}], self._conduct.poll_s, self._conduct.settled(axis).timeout_s)
        if came is not None and not side:
            self._do.arrivals[axis] = Arrival(came.side, came.start)
        if move is not None:
            self._do.moves[axis] = move
        self._do.settle(targets, self._conduct.settled, self._conduct.poll_s)


def _next(tries: Sequence[tuple[float, float]], aim: float, slope: float) -> float:
    """The next setting by the secant of the last two, or by the table's slope if they are one or do not tell."""
    setting, reading = tries[-1]
    if len(tries) > 1:
        before, read = tries[-2]
        secant = (reading - read) / (setting - before)
        # Two readings that are close together differ by their noise; their secant may have any slope.
        slope = secant if 0.2 < secant / slope < 5.0 else slope
    return setting + (aim - reading) / slope


def _not_reached(
    steered: Steered,
    level: float,
    near: float,
    tries: Sequence[tuple[float, float]],
    wanted: float,
    limits: tuple[float, float],
) -> str:
    factor, own = steered.factor, steered.own
    unit, volts = spelled(unit_of(factor.name)), spelled(unit_of(own.name))
    low, high = limits
    ends = "" if low <= wanted <= high else f"; it would take {wanted:.6g}, outside {low:g} to {high:g}"
    last = ", ".join(f"{reading:.6g} at {setting:.6g} {volts}" for setting, reading in tries[-3:])
    count = f"{len(tries)} setting{'s' * (len(tries) > 1)}"
    return (
        f"{factor.axis} does not reach {level:g} {unit} within {near:.3g}: its standard reads {last} after {count}"
        f"{ends}. Look at the supply and at the table of approach of references.{factor.name}, or change the level; "
        f"if the readings scatter, widen `near` of factors.{factor.name}"
    )


def overshot(steered: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """The flag of an observation before which a setting went beyond its level, if one did."""
    return [OVERSHOT] if any(OVERSHOT in one for one in steered.values()) else []
