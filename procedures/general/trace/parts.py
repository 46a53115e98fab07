"""Shapes that only some rows of a table follow: those of one operator, one range, one direction."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rig.fitter import ties
from rig.fitter.trace.flexible import Block, turns
from rig.fitter.trace.in_part import FEWEST, p_in_part
from rig.fitter.trace.outcome import Finding, remains
from rig.procedures.general.effects.scene import TableScene, at_levels
from rig.procedures.general.trace.unmodelled import UnmodelledSmooth

LEVELS = 6
"""Values of a column of numbers, at most, that is one of kinds of rows."""
CURVE = 3
"""Waves over a covariate, and over what was before; over a setting, all."""
SLOWEST, FASTEST, HARMONICS = 4, 16, 2
"""Periods over the range of a setting, and harmonics of each."""
PER_PERIOD = 3
"""Rows of a part for each period, at least."""
AGAIN, UNLIKELY = 4, 5.0
"""Clearest shapes that are asked under other covariances; nats behind the likeliest, beyond which one is not."""
UNEXPLAINED = 0.01
"""Probability below which a part follows a shape, over all parts and shapes."""


@dataclass(frozen=True, eq=False)
class Part:
    """Some of the rows.

    Attributes:
        variable: the column that picks them.
        words: its value.
        rows: (n,) which.

    """

    variable: str
    words: str
    rows: NDArray[np.bool_]


def in_parts(unmodelled: UnmodelledSmooth) -> Finding | None:
    """The clearest shape of a part of the rows that the residual follows there; None if there is none."""
    if not unmodelled.able:
        return None
    asked = [(part, block) for part in _parts(unmodelled.data.scene) for block in _shapes(unmodelled, part)]
    at = unmodelled.judge.beside(unmodelled.chosen).best
    first = [min(_p(unmodelled, part, block, k)[0] for k in {0, at}) for part, block in asked]
    best: tuple[float, float, str] = (UNEXPLAINED, 0.0, "")
    for k in ties.top(-np.asarray(first), AGAIN).tolist():
        part, block = asked[k]
        if first[k] * len(asked) < UNEXPLAINED:
            p, gain = _averaged(unmodelled, part, block)
            if ties.below(p * len(asked), best[0], 0.0):
                where = f"{block.place}, in the rows whose {part.variable} is {part.words}"
                best = p * len(asked), gain, where
    left = unmodelled.left_under(at)
    return remains(best[2], min(best[1] / float(left @ left), 1.0)) if best[2] else None


def _p(unmodelled: UnmodelledSmooth, part: Part, block: Block, under: int) -> tuple[float, float]:
    """P by chance of a shape of a part under one covariance, and the sum of squares it takes up."""
    judge, rows = unmodelled.judge, part.rows
    taken, white = judge.view(under).taken(unmodelled.chosen), unmodelled.white(block.columns, under)
    return p_in_part(judge.white(under, unmodelled.chosen)[rows], taken[rows], white[rows])


def _averaged(unmodelled: UnmodelledSmooth, part: Part, block: Block) -> tuple[float, float]:
    """The same under all covariances, ln p averaged by how likely each is beside the shape.

    What happens with one range only, while it is used, looks like a slow wander to who does not know the shape.
    """
    own = np.where(part.rows[:, None], block.columns, 0.0) / unmodelled.judge.problem.sd[:, None]
    beside = unmodelled.judge.beside(unmodelled.chosen, own)
    log = beside.reml + np.log(beside.noise.prior)
    weight = np.where(log > log.max() - UNLIKELY, np.exp(log - log.max()), 0.0)
    each = {int(k): _p(unmodelled, part, block, int(k)) for k in np.flatnonzero(weight)}
    total = sum(weight[k] * np.log(max(p, np.finfo(float).tiny)) for k, (p, _) in each.items())
    return float(np.exp(total / weight.sum())), each[ties.highest(log)][1]


def _parts(scene: TableScene) -> Iterator[Part]:
    kinds = {name: (g.index.astype(np.float64), g.levels) for name, g in {**scene.groups, **scene.labels}.items()}
    for name, v in scene.covariates.items():
        levels = np.unique(v)
        if 1 < levels.size <= LEVELS:
            kinds[name] = (np.searchsorted(levels, v).astype(np.float64), tuple(f"{one:g}" for one in levels))
    if scene.direction is not None:
        kinds[scene.direction[0]] = (scene.direction[1] + 1.0, ("-1", "0", "1"))
    for name, (index, words) in kinds.items():
        for k, word in enumerate(words):
            rows = index == k
            if FEWEST <= np.sum(rows) < len(rows):
                yield Part(name, word, rows)


def _shapes(unmodelled: UnmodelledSmooth, part: Part) -> Iterator[Block]:
    """Shapes for a part: over one setting or covariate, over settings before, and periods over a setting."""
    scene = unmodelled.data.scene
    for place in unmodelled.places:
        of_settings, block = place.variables <= set(scene.settings), place.block
        if part.variable in place.variables or len(place.variables) != 1 or not (place.curve or of_settings):
            continue
        if place.timed and not of_settings:
            continue
        most = block.columns.shape[1]
        for order in sorted({min(CURVE, most), most} if of_settings and not place.timed else {min(CURVE, most)}):
            yield Block(block.place, block.columns[:, :order], (order,), block.roughness[:order])
    for name, v in scene.settings.items():
        if name != part.variable and np.ptp(v) > 0:
            own = at_levels(v)
            u = (own - own.min()) / np.ptp(own)
            most = min(int(np.sum(part.rows)) // PER_PERIOD, (np.unique(np.round(u, 6)).size - 1) // 2, FASTEST)
            for k in range(SLOWEST, most + 1):
                columns = turns(360.0 * k * u, HARMONICS)
                rough = np.repeat(np.arange(1.0, columns.shape[1] // 2 + 1), 2)
                if columns.shape[1]:  # none where the setting has a value or two in each period
                    yield Block(f"periodic over {name}, {k} periods", columns, (columns.shape[1],), rough)
