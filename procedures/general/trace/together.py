"""The unmodelled smooth, rival of all names: a shape of all recorded quantities jointly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rig.fitter import ties
from rig.fitter.arrays import FloatArray
from rig.fitter.linear import orthonormal
from rig.fitter.trace.engine.judge import TableJudge
from rig.fitter.trace.engine.noise import Noise
from rig.fitter.trace.flexible import waves
from rig.fitter.trace.jointly import PER_COLUMN, Jointly, Metric, jointly, polynomials, spread_evenly
from rig.fitter.trace.limits import limit
from rig.fitter.trace.places import Place
from rig.procedures.general.effects.scene import TableScene, is_angle
from rig.procedures.general.trace.places import fine_of, place_over
from rig.procedures.general.trace.run import TableData

UNEXPLAINED = limit("unexplained", "general")
"""Probability below which there is a shape."""
WAVES = 12
"""Waves of a curve over one quantity."""


@dataclass(frozen=True, eq=False)
class Together:
    """A shape of recorded quantities that a residual follows.

    Attributes:
        place: its block of columns, to draw it.
        p: probability of as much by chance.
        share: of the residual.
        detail: more about it, behind its place.
    """

    place: Place
    p: float
    share: float
    detail: str


def together(judge: TableJudge, chosen: tuple[int, ...], data: TableData) -> Together | None:
    """A shape of recorded quantities jointly that the residual beside some effects follows; None for none.

    Asked with the rows' weights and, where these differ, without: a shape looks like noise that grows. Errors of rows
    may be alike as far as that is no shape itself: where rows are sorted by a setting, a walk along them is a curve
    over it. It is asked again with the slowest plausible noise, and p is the larger one.
    """
    known = data.scene.quantities
    if not known or np.ptp(judge.problem.y) == 0.0:
        return None
    values, sd = np.column_stack(list(known.values())), judge.problem.sd
    weights = [sd, np.ones_like(sd)] if np.ptp(sd) > 0.0 else [sd]
    beside = judge.beside(chosen)
    possible = ~beside.noise.slow if data.order_unknown else np.ones(len(beside.reml), np.bool_)
    under = tuple(dict.fromkeys((beside.best_of(possible), beside.slowest_of(possible))))
    limit = UNEXPLAINED / len(weights)
    found = [one for sd in weights if (one := _asked(judge, chosen, sd, under, values, limit)) is not None]
    if not found:
        return None
    best = ties.least(found, key=lambda one: one.p)
    names = [list(known)[k] for k in best.of]
    return _told(replace(best, p=best.p * len(weights)), {name: known[name] for name in names}, data.scene)


def _asked(
    judge: TableJudge, chosen: tuple[int, ...], sd: FloatArray, under: Sequence[int], values: FloatArray, limit: float
) -> Jointly | None:
    """The least significant of the shapes under several covariances; None as soon as one has none."""
    worst: Jointly | None = None
    noise = judge.problem.noise.over(sd)
    for at in under:
        found = jointly(_metric(judge, chosen, sd, noise, at), values, limit, judge.problem.near)
        if found is None:
            return None
        worst = found if worst is None or found.p > worst.p else worst
    return worst


def _told(found: Jointly, over: dict[str, FloatArray], scene: TableScene) -> Together:
    names = list(over)
    if found.degree:
        detail = f": polynomials of degree {found.degree} take up {100.0 * found.share:.0f} % of what is left"
    else:
        detail = ": readings whose settings are close to each other err alike, more finely than polynomials follow"
    if len(names) == 1:
        (name, v), *_ = over.items()
        columns = waves(v, WAVES)
        fine = None if is_angle(name, v) else fine_of(v, columns)
        place = place_over(scene, f"over {name}", columns, (name,), curve=name, finer=fine)
        return Together(place, found.p, found.share, detail)
    steps = polynomials(spread_evenly(np.column_stack(list(over.values()))), len(over[names[0]]) // PER_COLUMN)
    rough = np.repeat(np.arange(1.0, len(steps) + 1), [own.shape[1] for own in steps])
    text = f"over {', '.join(names[:-1])} and {names[-1]} together"
    place = place_over(scene, text, np.hstack(steps), tuple(names), rough)
    return Together(place, found.p, found.share, detail)


def _metric(judge: TableJudge, chosen: tuple[int, ...], sd: FloatArray, noise: Noise, at: int) -> Metric:
    """The residual beside some effects under one covariance, with rows divided by (n,) standard deviations."""
    problem, which = judge.problem, np.array([at])

    def white(columns: FloatArray) -> FloatArray:
        return np.asarray(noise.whiten(which, columns / sd[:, None])[0])

    taken = orthonormal(white(problem.model(chosen)))
    y = white(judge.held(chosen)[:, None])[:, 0]
    return Metric(y - taken @ (taken.T @ y), taken, white)
