"""A shape without a name in a table, drawn over what it follows, with the names nearest to it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.trace.doubts import DOUBT
from rig.fitter.trace.flexible import Block, halves, waves
from rig.fitter.trace.limits import limit
from rig.fitter.trace.lines import Line, over_phase
from rig.fitter.trace.outcome import Instead
from rig.fitter.trace.shape import Axis, Name, ResidualAndWaves, Shape, shape_of, standing_for
from rig.procedures.general.effects.scene import TableScene, is_angle
from rig.procedures.general.trace.places import PER_COLUMN, Place
from rig.procedures.general.trace.unmodelled import ResidualShape, UnmodelledSmooth

HARMONICS, FINE = int(limit("harmonics", "general")), int(limit("waves of a curve", "general"))
"""Harmonics of a period that its shape may have; waves of a curve that is drawn over one variable."""
PLACES = int(limit("places", "general"))
"""Clearest places at which a shape in place of doubtful names is looked for."""
STEP, SINCE = "over the step of ", " since each group's first row"
"""Beginning and end of the words for two places."""


def drawn(unmodelled: UnmodelledSmooth, left: ResidualShape) -> Shape | None:
    """The shape at a place; None where the likeliest is nothing."""
    place, scene = left.place, unmodelled.data.scene
    if place.curve is not None and not is_angle(place.curve, _values(scene, place.curve)):
        values = _values(scene, place.curve)
        columns = waves(values, max(min(FINE, values.size // PER_COLUMN), place.block.columns.shape[1]))
        fine = Block(place.block.place, columns, place.block.orders, halves(columns))
        place = replace(place, block=fine)
    return _drawn(unmodelled, place, left.p, axes_of(unmodelled, place))


def drawn_instead(unmodelled: UnmodelledSmooth, names: tuple[str, ...]) -> Instead | None:
    """One shape in place of all effects of some names; None without names, or where there is none."""
    if not names:
        return None
    candidates = unmodelled.judge.candidates
    rest = replace(unmodelled, chosen=tuple(j for j in unmodelled.chosen if candidates[j].effect.name not in names))
    own = [one for one in rest.left if one.p < DOUBT]
    found = standing_for(names, ((one.place.block.place, drawn(rest, one)) for one in own[:PLACES]))
    return None if found is None else Instead(names, *found)


def drawn_period(unmodelled: UnmodelledSmooth, found: Line) -> Shape | None:
    """A period, over its phase; None without what it is over."""
    time = unmodelled.data.scene.time
    n = unmodelled.judge.problem.n
    if found.over:
        at, period, unit = unmodelled.data.scene.of(found.over), found.period, found.unit
    elif time is None:
        return None
    elif found.unit == "readings":
        at, period, unit = np.argsort(np.argsort(time.values, kind="stable")).astype(np.float64), found.period, "rows"
    else:
        at, period, unit = time.values * (time.unit_s or 1.0), found.period, "s"
    most = min(HARMONICS, n // (2 * PER_COLUMN))
    block, axis = over_phase(found, unmodelled.left_under(0), at, period, unit, most)
    return _drawn(unmodelled, Place(block, frozenset(), timed=not found.over), found.p, (axis, None))


def _drawn(unmodelled: UnmodelledSmooth, place: Place, p: float, axes: tuple[Axis, Axis | None] | None) -> Shape | None:
    if axes is None:
        return None
    judge, sd = unmodelled.judge, unmodelled.judge.problem.sd
    at = judge.beside(unmodelled.chosen).best
    taken = judge.view(0).taken(unmodelled.chosen)
    plain = unmodelled.white(place.block.columns, 0)
    plain = plain - taken @ (taken.T @ plain)
    seen = ResidualAndWaves(
        plain=unmodelled.left_under(0) * sd,
        plain_columns=plain * sd[:, None],
        white=unmodelled.left_under(at),
        white_columns=unmodelled.leave(place.block.columns, at),
        roughness=place.block.roughness,
        df=sd.size - taken.shape[1],
    )
    return shape_of(seen, *axes, _names(unmodelled, at), unit="", p=p, stratum="row")


def _names(unmodelled: UnmodelledSmooth, at: int) -> Iterator[Name]:
    """Every candidate beside what was found."""
    view, candidates = unmodelled.judge.view(at), unmodelled.judge.candidates
    taken = view.taken(unmodelled.chosen)
    columns = view.columns - taken @ (taken.T @ view.columns)
    for j, one in enumerate(candidates):
        if j not in unmodelled.chosen:
            own = slice(int(view.start[j]), int(view.start[j + 1]))
            yield one.effect.name, columns[:, own], view.length[own]


def axes_of(unmodelled: UnmodelledSmooth, place: Place) -> tuple[Axis, Axis | None] | None:
    """The variable, and the second one, over which a place is drawn; None for a place that is not known."""
    scene, text = unmodelled.data.scene, place.block.place
    at = {name: text.find(name) for name in place.variables}
    names = sorted(place.variables, key=lambda name: (at[name], -len(name)))
    if not names:
        return None
    axes = [_axis(scene, name) for name in names[:2]]
    first = axes[0]
    if text.startswith(STEP):
        moved = np.diff(first.values, prepend=first.values[:1])
        first = Axis(f"{first.variable}_step", f"step of {first.label} before", "", moved, settable=True)
    if text.startswith("over earlier "):
        before = np.concatenate([first.values[:1], first.values[:-1]])
        first = Axis(f"{first.variable}_before", f"{first.label} of the row before", "", before, settable=True)
    if text.endswith(SINCE) and unmodelled.data.shared is not None:
        group = unmodelled.data.shared
        start = np.full(int(group.max()) + 1, np.inf)
        np.minimum.at(start, group, first.values)
        first = replace(first, label=f"{first.label} since the group's first row", values=first.values - start[group])
    second = axes[1] if len(axes) > 1 else None
    if second is not None and scene.direction is not None and first.variable == scene.direction[0]:
        return second, first
    if second is not None and first.variable in {**scene.groups, **scene.labels}:
        return second, first
    return first, second


def _axis(scene: TableScene, name: str) -> Axis:
    return Axis(name, name, "", _values(scene, name), settable=name in scene.settings)


def _values(scene: TableScene, name: str) -> FloatArray:
    """(n,) of a setting, a covariate, the time, the direction, or the number of a group's level."""
    if scene.time is not None and name == scene.time.name:
        return scene.time.values
    if scene.direction is not None and name == scene.direction[0]:
        return scene.direction[1]
    groups = {**scene.groups, **scene.labels}
    if name in groups:
        return groups[name].index.astype(np.float64)
    return scene.of(name)
