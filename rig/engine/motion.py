"""How the axes get to a point so that every axis arrives from its planned side.

A worm gear reaches the same encoder reading at two slightly different angles, depending on which flank it last
pushed on. So the side of approach is part of the design: an axis that cannot come from its planned side directly
first goes beyond it. After an interruption nothing is known of the last move, and the last point's history is
gone too; then every axis goes beyond, through the previous point, to the point.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from procedures.run_list import Factor, Point

Leg = dict[str, float]
"""Targets by axis; all axes of a leg start together, and a leg ends when none moves."""


@dataclass(frozen=True)
class Arrival:
    """How an axis last came to rest.

    Attributes:
        side: +1 if it came moving upwards, -1 downwards.
        start: readback when that move began.

    """

    side: int
    start: float


def _moved(factors: Sequence[Factor], point: Point) -> Iterator[tuple[Factor, float, int]]:
    """(factor, target, side) of what moves from point to point."""
    for factor, target, side in zip(factors, point.setpoints, point.sides, strict=True):
        if not factor.hard:
            yield factor, target, side


def plan_legs(
    factors: Sequence[Factor],
    point: Point,
    now: Mapping[str, float],
    arrivals: Mapping[str, Arrival],
    tolerance: float,
) -> list[Leg]:
    """Legs from where the axes are to a point.

    Args:
        factors: what the point's setpoints mean.
        point: where to go, and from which sides.
        now: present position by axis.
        arrivals: how each axis came to be there; an axis that is missing is of unknown history.
        tolerance: an axis this close to its setpoint, having come from its planned side, stays.

    Returns:
        No leg (nothing to move), one (direct), or two (some axes first go beyond).

    """
    beyond: Leg = {}
    final: Leg = {}
    for factor, target, side in _moved(factors, point):
        axis = factor.axis
        here = now[axis]
        arrival = arrivals.get(axis)
        came_right = arrival is not None and side in (0, arrival.side)
        if factor.stays and came_right and abs(here - target) <= tolerance:
            continue
        if side and side * (target - here) < factor.overtravel:
            beyond[axis] = target - side * factor.overtravel
        final[axis] = target
    return [leg for leg in (beyond, final) if leg]


def recovery_legs(factors: Sequence[Factor], point: Point, previous: Point | None) -> list[Leg]:
    """Legs to a point after an interruption: beyond the previous point, to it, then on to the point itself.

    Args:
        factors: what the setpoints mean.
        point: where the run goes on.
        previous: the point before it in the run list; None at the very first.

    """
    first = point if previous is None else previous
    moved = list(_moved(factors, first))
    beyond = {f.axis: target - side * f.overtravel for f, target, side in moved}
    to_first = {f.axis: target for f, target, _ in moved}
    legs = [to_first] if beyond == to_first else [beyond, to_first]
    if previous is not None:
        arrivals = {f.axis: Arrival(side, beyond[f.axis]) for f, _, side in moved}
        legs += plan_legs(factors, point, to_first, arrivals, tolerance=0.0)
    return legs


def arrived(leg: Leg, start: Mapping[str, float], arrivals: dict[str, Arrival]) -> None:
    """Note how the axes of a finished leg came to rest.

    Args:
        leg: the targets that were commanded.
        start: readbacks when the leg began.
        arrivals: brought up to date in place.

    """
    for axis, target in leg.items():
        if target != start[axis]:
            arrivals[axis] = Arrival(1 if target > start[axis] else -1, start[axis])
