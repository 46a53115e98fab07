"""Robust tests of a unit near significance: errors that are unequal, shared, or slow.

Its score is computed again with the errors

- from the scatter of each observation's own contribution, valid for unequal variances and for head errors common to
  several sensors;
- for effects in time, from the scatter over stretches of the run, valid for a slow random walk of the noise;
- from the random walk of the offset, if the residual shows one (`wander.py`);

and it has to explain the residual better than a random walk with the same freedom, by the ratio of their restricted
likelihoods (`walks.py`): a walk too small to be detected in the scatter still looks like drift.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.procedures.attitude.trace.levels import Level
from rig.procedures.attitude.trace.problem import Problem
from rig.procedures.attitude.trace.score import errors, inverse
from rig.procedures.attitude.trace.view import View
from rig.procedures.attitude.trace.walks import SPREAD, likelihood_ratio
from rig.procedures.attitude.trace.wander import walk_evidence

WALKS = 0.05
"""Probability of a walk in a residual by chance, below which an effect is compared with large walks too."""
MOST = 100.0
"""Logarithm of a ratio beyond which more makes no difference."""


def walked(problem: Problem, columns: FloatArray) -> FloatArray:
    """(q, q) contribution of the walk of the offsets to the covariance of columns' (S, n, q) products with the outputs.

    Every replication's offset is removed from the columns, so the walk may start again in each.
    """
    ahead = np.cumsum(columns[:, problem.levels.executed], axis=1)
    return np.asarray(np.einsum("s,snj,snk->jk", problem.wander, ahead, ahead))


def in_part(problem: Problem, chosen: tuple[int, ...], u: int) -> tuple[float, float, float]:
    """Twice the log-likelihood ratio of a unit within replications beside the `chosen` candidates, for independent
    errors; the smallest of robust ones over it; and that to a random walk, infinite if not asked.
    """
    level, columns, outputs, length2 = _seen(problem, chosen, problem.units[u])
    products, d, spread, meats = _scatter(problem, level, columns, outputs, length2)
    plain, rank = float(d @ spread @ d), round(float(np.sum(spread * products)))
    if rank == 0 or plain <= 0.0:
        return 0.0, 1.0, np.inf
    if np.any(problem.wander):
        meats.append(products + walked(problem, columns))
    least = min(plain, *(float(d @ inverse(meat, length2, rank) @ d) for meat in meats))
    asked = problem.levels.df(level) > 0
    against = plain * _beside_walks(problem, level, columns, outputs) if asked else np.inf
    if asked and level == "points" and _walking(problem, outputs - columns @ (spread @ d)):
        # without the means of points a walk is none any more, if its points come in random order
        view = View(problem, "replications", chosen, errors(problem, chosen))
        wide = _against_walks(problem, "replications", view.each(problem.units[u]), view.outputs, wide=True)
        against = min(against, max(wide, 0.0))
    return plain, least / plain, against


def _seen(
    problem: Problem, chosen: tuple[int, ...], unit: tuple[int, ...]
) -> tuple[Level, FloatArray, FloatArray, FloatArray]:
    """Level at which a unit is judged, (S, n, q) its columns there over the errors, (S, n) the outputs, and
    (q,) squared lengths of columns before anything was removed.
    """
    level, sigma = problem.judged_at[unit[0]], errors(problem, chosen)
    view = View(problem, level, chosen, sigma)
    return level, view.each(unit), view.outputs, np.sum((problem.length[:, list(unit)] / sigma[:, None]) ** 2, axis=0)


def _scatter(
    problem: Problem, level: Level, columns: FloatArray, outputs: FloatArray, length2: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, list[FloatArray]]:
    """(q, q) products of columns, (q,) with the outputs, the inverse, and covariances of products by scatter."""
    products, d = np.einsum("snj,snk->jk", columns, columns), np.einsum("snj,sn->j", columns, outputs)
    spread = inverse(products, length2)
    own = np.einsum("snj,sn->nj", columns, outputs - columns @ (spread @ d))
    meats = [own.T @ own]
    if level == problem.levels.of_error:
        by_stretch = np.zeros((int(problem.levels.stretch.max()) + 1, own.shape[1]))
        np.add.at(by_stretch, problem.levels.stretch, own)
        meats.append(by_stretch.T @ by_stretch)
    return products, d, spread, meats


def _beside_walks(problem: Problem, level: Level, columns: FloatArray, outputs: FloatArray) -> float:
    """Share of what some columns explain that is left beside a random walk.

    Both are by likelihood: of few readings it explains less than over a known scatter, walk or not.
    """
    still = _against_walks(problem, level, columns, outputs, steps=1)
    return max(_against_walks(problem, level, columns, outputs), 0.0) / still if still > 0.0 else 1.0


def _against_walks(
    problem: Problem,
    level: Level,
    columns: FloatArray,
    outputs: FloatArray,
    *,
    wide: bool = False,
    steps: int | None = None,
) -> float:
    """Sum of squares, over scatter, that amounts to the likelihood ratio to a random walk of the first few `steps`."""
    moved = np.flatnonzero(np.any(columns != 0, axis=(1, 2)))
    # a shape that repeats in every replication is not a random walk, even if it is smooth in time
    spread = SPREAD if wide or level == problem.levels.of_error else 1.0
    walks, n = problem.levels.walks(level, wide=wide), len(moved) * problem.levels.df(level)
    walks = replace(walks, widths=walks.widths[:steps])
    ratio = likelihood_ratio(walks, list(outputs[moved]), list(columns[moved]), spread)
    # a likelihood ratio grows with the logarithm of what a large effect explains
    return float(n * np.expm1(min(ratio / n, MOST)))


def _walking(problem: Problem, left: FloatArray) -> bool:
    """Whether a residual (S, n) within replications walks in any sensor."""
    return any(walk_evidence(problem, one)[0] < WALKS for one in left)
