"""Places for a shape without a name in a table: blocks of smooth columns over recorded quantities."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.trace.flexible import orders_of, rough_turns, turns, waves
from rig.fitter.trace.latches import latches
from rig.fitter.trace.limits import limit
from rig.fitter.trace.places import Axes, Place, as_one, centred, finer, products, since, smooth
from rig.fitter.trace.shape import Axis
from rig.procedures.general.effects.scene import Grouping, TableScene, at_levels, is_angle
from rig.procedures.general.effects.time_columns import lagging

OVER, TIME, BESIDE = 12, 12, 6
"""Maximum number of waves over a setting or covariate, over the time, and in products."""
BOTH = 4
"""Number of waves of each of two variables in their products."""
MEMORIES = 5
"""Number of time constants for the memory of earlier settings."""
PAIRS = 8
"""Maximum number of pairs of variables."""
LEVELS, FEWEST_CHANGES, STAYS = 8, 2, 4
"""A variable that stays for a while: its most levels, its fewest changes, its fewest rows at one level on average."""
TURNS = 60
"""Most changes of a variable beside which each turn between them has an offset of its own."""
FEWEST_CHANGED = 6
"""Fewest rows in which something has just changed, and in which it has not."""
PRACTICE = 2
"""Waves over how often the same level of a group had its turn before."""
EVERY, CYCLES = 12, 6
"""Rows after which something may come again, at most, and how often it has to, at least."""
PER_COLUMN = 4
"""Minimum number of rows for each column of a block."""
FINE = int(limit("waves of a curve", "general"))
"""Waves of a curve that is drawn over one variable: more than are tested."""


def places_of(scene: TableScene, group: IntArray | None) -> tuple[Place, ...]:
    """All places of a table.

    Args:
        scene: the table.
        group: (n,) whole plot or replication of each row.

    """
    every = (*_over(scene), *_in_time(scene, group), *_of_sides(scene), *_of_groups(scene), *_of_pairs(scene))
    return tuple(place for place in every if place.orders)


def axes_over(scene: TableScene, *names: str) -> Callable[[int], Axes | None]:
    """Makes what a place over variables of a table is drawn over; no more than two of them."""

    def make(_i: int) -> Axes | None:
        each = [Axis(name, name, "", values_of(scene, name), settable=name in scene.settings) for name in names[:2]]
        return (each[0], each[1] if len(each) > 1 else None) if each else None

    return make


def values_of(scene: TableScene, name: str) -> FloatArray:
    """(n,) of a setting, a covariate, the time, the direction, or the number of a group's level."""
    if scene.time is not None and name == scene.time.name:
        return scene.time.values
    if scene.direction is not None and name == scene.direction[0]:
        return scene.direction[1]
    groups = {**scene.groups, **scene.labels}
    return groups[name].index.astype(np.float64) if name in groups else scene.of(name)


def _other(label: str, variable: str, values: FloatArray) -> Callable[[int], Axes]:
    """Makes an axis of something derived from a setting."""
    return lambda _i: (Axis(variable, label, "", values, settable=True), None)


def _over(scene: TableScene) -> Iterator[Place]:
    for name, v in scene.variables.items():
        if is_angle(name, v):
            columns, rough = _angular(v, OVER // 2)
            yield place_over(scene, f"over {name}", columns, (name,), rough, curve=name)
        else:
            columns = waves(at_levels(v) if name in scene.settings else v, _most(v, OVER))
            yield place_over(scene, f"over {name}", columns, (name,), curve=name, finer=fine_of(v, columns))
        levels, index = np.unique(v, return_inverse=True)
        if 2 < len(levels) <= len(v) // 2 and name in scene.settings:
            own = (index[:, None] == np.arange(1, len(levels))).astype(np.float64)
            yield _as_one(scene, f"over {name}, each value by itself", own, name)


def _in_time(scene: TableScene, group: IntArray | None) -> Iterator[Place]:
    time = scene.time
    if time is None:
        return
    t = time.values
    along = waves(t, _most(t, TIME))
    yield place_over(
        scene, f"over {time.name}", along, (time.name,), curve=time.name, timed=True, finer=fine_of(t, along)
    )
    if time.presumed:
        return
    number = np.argsort(np.argsort(t, kind="stable"))
    for every in range(2, min(EVERY, len(t) // CYCLES) + 1):
        own = (number[:, None] % every == np.arange(1, every)).astype(np.float64)
        yield _as_one(scene, f"along the run, again after {every} rows", own, time.name, timed=True)
    for name, v in scene.settings.items():
        own = centred(v)[:, None] * along[:, :BESIDE]
        yield place_over(scene, f"over {time.name}, times {name}", own, (time.name, name), timed=True)
    if group is not None and np.any(np.diff(t) > 0):
        start = since(group, t)
        columns = waves(start, _most(t, BESIDE)) if np.ptp(start) > 0 else np.empty((len(t), 0))
        axis = Axis(time.name, f"{time.name} since the group's first row", "", start)
        text = f"over {time.name} since each group's first row"
        yield replace(place_over(scene, text, columns, (time.name,), timed=True), axes=lambda _i: (axis, None))
    for name, start, turn in _turns(scene, group):
        columns = waves(start, _most(t, BESIDE))
        yield place_over(scene, f"over {time.name} since {name} changed", columns, (time.name, name), timed=True)
        if turn[-1] > TURNS:
            continue
        own = (turn[:, None] == np.arange(1, int(turn.max()) + 1)).astype(np.float64)
        text = f"with an offset of its own from each change of {name} to the next"
        yield _as_one(scene, text, own, time.name, name, timed=True)
    for name, v in scene.variables.items():
        state = latches(v, np.arange(len(v)))
        if np.any(state):
            yield _as_one(scene, f"after the last extreme of {name}", state, name, timed=True)
    yield from _of_changes(scene)
    gap = np.diff(t)
    for name, v in scene.settings.items():
        if np.ptp(v) == 0 or not np.any(gap > 0):
            continue
        move = np.diff(v, prepend=v[:1])
        scale = float(np.median(np.abs(move[move != 0]))) if np.any(move != 0) else 1.0
        moved = waves(np.arcsinh(move / scale), BESIDE) if np.ptp(move) > 0 else np.empty((len(v), 0))
        step = _other(f"step of {name} before", f"{name}_step", move)
        text = f"over the step of {name} before"
        yield replace(place_over(scene, text, moved, (name,), timed=True), axes=step)
        if len(v) >= 20:
            usual = float(np.median(gap[gap > 0]))
            constants = np.geomspace(0.5 * usual, float(np.ptp(t)) / 3.0, MEMORIES)
            u, stood = centred(v), scene.stood(name)
            stood = stood and stood.on(0.5 * float(v.min() + v.max()), 0.5 * float(np.ptp(v)))
            own = np.column_stack([lagging(u, gap, tau, stood) - u for tau in constants])
            before = _other(f"{name} of the row before", f"{name}_before", np.concatenate([v[:1], v[:-1]]))
            orders, text = orders_of(own, (1, 2, MEMORIES)), f"over earlier {name}"
            yield replace(_as_one(scene, text, own, name, timed=True), orders=orders, axes=before)


def _of_changes(scene: TableScene) -> Iterator[Place]:
    """Rows in which a group, a text, a direction or a number of few levels has just changed; times other numbers."""
    groups = {**scene.groups, **scene.labels}
    kinds: dict[str, IntArray | FloatArray] = {name: g.index for name, g in groups.items() if not g.declared}
    kinds |= {name: v for name, v in scene.covariates.items() if len(np.unique(v)) <= LEVELS}
    if scene.direction is not None:
        kinds[scene.direction[0]] = scene.direction[1]
    for name, v in kinds.items():
        just = _changes(v).astype(np.float64)
        if FEWEST_CHANGED <= just.sum() <= len(just) - FEWEST_CHANGED:
            numbers = [centred(of) for other, of in scene.variables.items() if other != name and np.ptp(of) > 0]
            own = just[:, None] * np.column_stack([np.ones(len(just)), *numbers[:BESIDE]])
            text = f"in rows where {name} has just changed"
            yield place_over(scene, text, own, (name,), np.ones(own.shape[1]), timed=True)


def _turns(scene: TableScene, group: IntArray | None) -> Iterator[tuple[str, FloatArray, IntArray]]:
    """Each variable of few levels, such as an operator, that stays for some rows; time since it changed, and turns."""
    assert scene.time is not None
    known = [np.zeros(len(scene.time.values), np.intp) if group is None else np.cumsum(_changes(group))]
    groups = {**scene.groups, **scene.labels}
    spells = {name: _changes(g.index) for name, g in groups.items() if not g.declared}
    spells |= {name: _changes(v) for name, v in scene.covariates.items() if len(np.unique(v)) <= LEVELS}
    for name, changed in spells.items():
        spell = np.cumsum(changed)
        if spell[-1] < FEWEST_CHANGES or len(spell) < STAYS * (spell[-1] + 1):
            continue
        start = since(spell, scene.time.values)
        if np.ptp(start) > 0 and not any(np.array_equal(spell, one) for one in known):
            known.append(spell)
            yield name, start, spell


def _changes(v: IntArray | FloatArray) -> IntArray:
    """(n,) 1 where a row differs from the one before it, else 0."""
    return np.concatenate([[0], v[1:] != v[:-1]]).astype(np.intp)


def _of_sides(scene: TableScene) -> Iterator[Place]:
    if scene.direction is None:
        return
    side, sign = scene.direction
    for name, v in scene.variables.items():
        columns = sign[:, None] * np.column_stack([np.ones(len(v)), waves(v, _most(v, BESIDE))])
        yield place_over(scene, f"over {side} and {name}", columns, (name, side))


def _of_groups(scene: TableScene) -> Iterator[Place]:
    for name, g in {**scene.groups, **scene.labels}.items():
        if g.declared or not 1 < len(g.levels) <= len(g.index) // 3:
            continue
        own = g.indicators[:, 1:]
        yield _as_one(scene, f"over {name}", own, name)
        if scene.time is not None and not scene.time.presumed and len(g.levels) <= LEVELS:
            yield from _of_practice(scene, name, g)
        for setting, v in scene.settings.items():
            yield _as_one(scene, f"over {name} and {setting}", own * centred(v)[:, None], setting, name)


def _of_practice(scene: TableScene, name: str, g: Grouping) -> Iterator[Place]:
    """Each level's offset, and one level that changes the more often it had its turn."""
    smooth = waves(practice(g.index), PRACTICE)
    for level, rows in zip(g.levels, g.indicators.T, strict=True):
        own = rows[:, None] * smooth
        both = np.column_stack([g.indicators[:, 1:], own])
        text = f"over {name}, and over how often {level} had its turn before"
        yield _as_one(scene, text, both, name, timed=True, alternatives=len(g.levels))


def practice(index: IntArray) -> FloatArray:
    """(n,) logarithm of the number of rows of the same level up to a row: what a person or a part has got used to."""
    own = index[:, None] == np.arange(int(index.max()) + 1)
    return np.asarray(np.log(np.cumsum(own, axis=0)[np.arange(len(index)), index]))


def _of_pairs(scene: TableScene) -> Iterator[Place]:
    names = [*scene.settings, *scene.covariates]
    pairs = [pair for pair in combinations(names, 2) if pair[0] in scene.settings]
    for a, b in pairs[:PAIRS]:
        every = (at_levels(scene.of(name)) if name in scene.settings else scene.of(name) for name in (a, b))
        one, other = (waves(v, min(_most(v, BESIDE), BOTH)) for v in every)
        columns, rough = products(one, other)
        if rough.size and rough.size * PER_COLUMN <= len(one):
            yield place_over(scene, f"over {a} and {b}", columns, (a, b), rough)


def place_over(
    scene: TableScene,
    text: str,
    columns: FloatArray,
    names: tuple[str, ...],
    rough: FloatArray | None = None,
    **more: Any,
) -> Place:
    """A place of smooth columns (n, m) over variables of a table, by default waves; `more` are its attributes."""
    return smooth(text, columns, axes_over(scene, *names), rough, variables=frozenset(names), **more)


def _as_one(scene: TableScene, text: str, columns: FloatArray, *names: str, **more: Any) -> Place:
    return as_one(text, columns, axes_over(scene, *names), variables=frozenset(names), **more)


def fine_of(v: FloatArray, columns: FloatArray) -> Callable[[], FloatArray]:
    """Makes more waves of a curve than are tested, as far as the rows tell them."""
    return finer(v, max(min(FINE, v.size // PER_COLUMN), columns.shape[1]))


def _most(v: FloatArray, wanted: int) -> int:
    """Waves over a variable: no more than a quarter of its rows."""
    return min(wanted, len(v) // PER_COLUMN)


def _angular(v: FloatArray, most: int) -> tuple[FloatArray, FloatArray]:
    columns = turns(v, min(most, len(v) // (2 * PER_COLUMN)))
    return columns, rough_turns(columns)
