"""Motion to a point, such that every axis arrives from its planned side.

A worm gear reaches the same encoder reading at two slightly different angles, depending on which flank it last
pushed on. So the side of approach is part of the design: an axis that cannot come from its planned side directly
first goes beyond it. After an interruption nothing is known about the last move or the
approach of the last point. Every axis then goes beyond the previous point, to that point, and on to the next one.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

from rig.procedures.plan.run_list import Factor, Point

Leg = dict[str, float]
"""Targets by axis; all axes of a leg start together, and a leg ends when none moves."""
NEARLY = 0.9
"""Smallest fraction of its overtravel that an axis must cover: it may turn a little short of the full overtravel."""


@dataclass(frozen=True)
class Arrival:
    """The last approach of an axis.

    Attributes:
        side: +1 if it came moving upwards, -1 downwards.
        start: readback when that move began.

    """

    side: int
    start: float


class Move(NamedTuple):
    """The last move of an axis away from a setting.

    Attributes:
        at: clock time of the step that has the same mean over time as the move.
        start: readback when it began.
        settled: whether `at` counts what was on its way while the axis settled.
    """

    at: float
    start: float
    settled: bool = False


def delay_of_step(samples: Sequence[tuple[float, float]], start: float, end: float) -> float:
    """Seconds from the first sample of a move to the step that has the same mean: what follows late cannot tell them.

    Args:
        samples: seconds and readbacks.
        start: readback before the move; not `end`.
        end: its target.
    """
    left = [(t, min(max((end - value) / (end - start), 0.0), 1.0)) for t, value in samples]
    return sum(0.5 * (a + b) * (to - since) for (since, a), (to, b) in pairwise(left))


def _moved(factors: Sequence[Factor], point: Point, axes: Collection[str]) -> Iterator[tuple[Factor, float, int]]:
    """(factor, target, side) of every factor that an axis moves from point to point."""
    for factor, target, side in zip(factors, point.setpoints, point.sides, strict=True):
        if not factor.hard and factor.axis in axes:
            yield factor, target, side


def plan_legs(
    factors: Sequence[Factor],
    point: Point,
    now: Mapping[str, float],
    arrivals: Mapping[str, Arrival],
    tolerance: Callable[[str], float],
) -> list[Leg]:
    """Legs from where the axes are to a point.

    Args:
        factors: meaning of the point's setpoints.
        point: the target, and the sides to arrive from.
        now: present position by axis; factors without an axis here are left out.
        arrivals: last approach of each axis; the history of a missing axis is unknown.
        tolerance: an axis this close to its setpoint stays, if it arrived from its planned side; by axis.

    Returns:
        No leg (nothing to move), one (direct), or two (some axes first go beyond).

    """
    beyond: Leg = {}
    final: Leg = {}
    for factor, target, side in _moved(factors, point, now):
        axis = factor.axis
        here = now[axis]
        arrival = arrivals.get(axis)
        came_right = arrival is not None and side in (0, arrival.side)
        # Not where the error belongs to the setting, as with a pressure: that is set again for every point.
        if factor.stays and came_right and abs(here - target) <= tolerance(axis):
            continue
        # Nearer than its overtravel, backlash might not be taken up by the time it arrives.
        if side and side * (target - here) < factor.overtravel:
            beyond[axis] = target - side * factor.overtravel
        final[axis] = target
    return [leg for leg in (beyond, final) if leg]


def recovery_legs(
    factors: Sequence[Factor], point: Point, previous: Point | None, axes: Collection[str] | None = None
) -> list[Leg]:
    """Legs to a point after an interruption: beyond the previous point, to it, then on to the point itself.

    Args:
        factors: meaning of the setpoints.
        point: where the run continues.
        previous: the point before it in the run list; None at the very first.
        axes: that instruments move; None if every factor that is easy to change has one.

    """
    axes = {f.axis for f in factors} if axes is None else axes
    first = point if previous is None else previous
    moved = list(_moved(factors, first, axes))
    beyond = {f.axis: target - side * f.overtravel for f, target, side in moved}
    to_first = {f.axis: target for f, target, _ in moved}
    if not moved:
        return []
    legs = [to_first] if beyond == to_first else [beyond, to_first]
    if previous is not None:
        arrivals = {f.axis: Arrival(side, beyond[f.axis]) for f, _, side in moved}
        legs += plan_legs(factors, point, to_first, arrivals, lambda _: 0.0)
    return legs


def arrived(leg: Leg, start: Mapping[str, float], arrivals: dict[str, Arrival]) -> None:
    """Note the approach of the axes after a leg.

    Args:
        leg: commanded targets.
        start: readbacks at the start of the leg.
        arrivals: updated in place.

    """
    for axis, target in leg.items():
        if target != start[axis]:
            arrivals[axis] = Arrival(1 if target > start[axis] else -1, start[axis])
