"""Order of the points of one replication, and the side from which each setting is approached.

Settings of hard-to-change factors are visited one after another. At each, settings of factors in random order are
visited in random order. At each of these, factors that are swept (up-down, as written) run through their levels, the
first one slowest. So a sweep is never interrupted by a change of another factor.

The rows of a file are steps: what is as written keeps their order, and a setting that comes again is visited again.
"""

from __future__ import annotations

import itertools
import random
from collections.abc import Iterator, Sequence

from rig.procedures.general.factors import AS_WRITTEN, RANDOM

Setting = tuple[float, ...]

_ORDERS_TRIED = 1000


def visits(
    points: Sequence[Setting],
    orders: Sequence[str],
    hard: Sequence[bool],
    rng: random.Random,
    before: Setting | None,
    plots: Sequence[int] | None = None,
    *,
    steps: bool = False,
) -> Iterator[tuple[int, Setting]]:
    """Points of one replication in running order, each with the number of its whole plot, from 0.

    Args:
        points: one value per factor; equal points are visited as often as they occur.
        orders: of each factor.
        hard: whether each factor is hard to change.
        rng: random generator.
        before: last hard settings of the replication before, which no whole plot repeats at once if that can be
            avoided; None for the first replication, or without hard factors.
        plots: whole plot of each point; None if points with the same hard settings share one.
        steps: whether the points are steps in their order, as the rows of a file: factors as written run through them
            in that order, and points with the same hard settings share a whole plot only as neighbours.
    """
    stiff = [at for at, one in enumerate(hard) if one]
    loose = [at for at, one in enumerate(hard) if not one]
    swept = [at for at in loose if orders[at] != RANDOM]
    in_turn = steps and all(orders[at] == AS_WRITTEN for at in stiff)
    if plots is not None:
        groups = _by_plot(points, stiff, plots)
    else:
        groups = _runs(points, stiff) if in_turn else list(_grouped(points, stiff).items())
    order = list(range(len(groups)))
    if not in_turn:
        order = _plots([key for key, _ in groups], [orders[at] for at in stiff], rng, before)
    for number, which in enumerate(order):
        for group in _at_random(groups[which][1], loose, orders, rng):
            for point in _sweep(group, swept, orders, steps=steps):
                yield number, point


def _by_plot(
    points: Sequence[Setting], stiff: Sequence[int], plots: Sequence[int]
) -> list[tuple[Setting, list[Setting]]]:
    """Hard settings and points of each whole plot."""
    found: dict[int, list[Setting]] = {}
    for point, plot in zip(points, plots, strict=True):
        found.setdefault(plot, []).append(point)
    return [(tuple(inside[0][i] for i in stiff), inside) for inside in found.values()]


def _grouped(points: Sequence[Setting], at: Sequence[int]) -> dict[Setting, list[Setting]]:
    """Points by their values of some factors, in order of first appearance."""
    found: dict[Setting, list[Setting]] = {}
    for point in points:
        found.setdefault(tuple(point[i] for i in at), []).append(point)
    return found


def _runs(points: Sequence[Setting], at: Sequence[int]) -> list[tuple[Setting, list[Setting]]]:
    """Neighbouring points with the same values of some factors, in their order."""
    found = itertools.groupby(points, lambda point: tuple(point[i] for i in at))
    return [(key, list(inside)) for key, inside in found]


def _plots(keys: Sequence[Setting], orders: Sequence[str], rng: random.Random, before: Setting | None) -> list[int]:
    """Places of whole plots in running order, by their hard settings: in random order, without equal settings in
    succession if that can be avoided; or swept if no factor is in random order.
    """
    places = list(range(len(keys)))
    if not orders:
        return places
    if RANDOM not in orders:
        at: dict[Setting, list[int]] = {}
        for place, key in enumerate(keys):
            at.setdefault(key, []).append(place)
        return [place for key in _sweep(list(at), range(len(orders)), orders) for place in at[key]]
    for _ in range(_ORDERS_TRIED):
        rng.shuffle(places)
        if all(a != b for a, b in itertools.pairwise([before, *(keys[place] for place in places)])):
            break
    return places


def _at_random(
    points: Sequence[Setting], loose: Sequence[int], orders: Sequence[str], rng: random.Random
) -> list[list[Setting]]:
    """Groups in random order, each with equal settings of the factors in random order."""
    free = [at for at in loose if orders[at] == RANDOM]
    if len(free) == len(loose):  # nothing is swept: equal points need not stay together
        alone = [[point] for point in points]
        rng.shuffle(alone)
        return alone
    groups = list(_grouped(points, free).values())
    rng.shuffle(groups)
    return groups


def _sweep(
    points: Sequence[Setting], swept: Sequence[int], orders: Sequence[str], *, steps: bool = False
) -> Iterator[Setting]:
    """Points in the order of the swept factors, the first slowest."""
    if not swept:
        yield from points
        return
    first, *others = swept
    if steps and orders[first] == AS_WRITTEN:
        turns = [inside for _, inside in _runs(points, [first])]
    else:
        levels = _grouped(points, [first])
        up = sorted(levels)
        keys = list(levels) if orders[first] == AS_WRITTEN else [*up, *up[-2::-1]]
        turns = [levels[key] for key in keys]
    for inside in turns:
        yield from _sweep(inside, others, orders, steps=steps)


def sides(settings: Sequence[Setting], sideless: Sequence[bool]) -> Iterator[tuple[int, ...]]:
    """Side of approach of each setting, by factor: from the setting before; 0 for any, as for the first one.

    A factor that keeps its setting has the side from which it came there.

    Args:
        settings: in running order.
        sideless: whether each factor has no side.
    """
    width = len(settings[0]) if settings else 0
    last = [0] * width
    yield tuple(last)
    for then, now in itertools.pairwise(settings):
        for at in range(width):
            if now[at] != then[at]:
                last[at] = 0 if sideless[at] else (1 if now[at] > then[at] else -1)
        yield tuple(last)
