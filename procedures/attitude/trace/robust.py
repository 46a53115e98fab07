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

import numpy as np
from scipy import special

from rig.fitter.arrays import FloatArray
from rig.procedures.attitude.trace.problem import Problem
from rig.procedures.attitude.trace.score import Scores, errors, inverse, whiten
from rig.procedures.attitude.trace.walks import SPREAD, likelihood_ratio


def second_thoughts(problem: Problem, chosen: tuple[int, ...], u: int, scores: Scores, critical: float) -> float:
    """The largest p of a unit, beside the `chosen` candidates.

    Args:
        problem: the run.
        chosen: candidates in the model.
        u: the unit.
        scores: of all units beside the same candidates.
        critical: the largest significant p; after one larger p no further test is made.
    """
    unit, rank = problem.units[u], int(scores.rank[u])
    if rank == 0:
        return 1.0
    level, sigma = problem.judged_at[unit[0]], errors(problem, chosen)
    white = whiten(problem, level, chosen, sigma, unit)
    columns, length2 = white.columns, np.sum((problem.length[:, list(unit)] / sigma[:, None]) ** 2, axis=0)
    products = np.einsum("snj,snk->jk", columns, columns)
    d = np.einsum("snj,sn->j", columns, white.outputs)
    gamma = inverse(products, length2) @ d
    own = np.einsum("snj,sn->nj", columns, white.outputs - columns @ gamma)
    meats = [own.T @ own]
    if level == problem.levels.of_error:
        by_stretch = np.zeros((int(problem.levels.stretch.max()) + 1, len(unit)))
        np.add.at(by_stretch, problem.levels.stretch, own)
        meats.append(by_stretch.T @ by_stretch)
    if np.any(problem.wander):
        plain = scores.gain[u] / max(scores.f[u] * rank, np.finfo(float).tiny)
        meats.append(products * plain + walked(problem, columns))
    f = min(scores.f[u], *(float(d @ inverse(meat, length2, rank) @ d) / rank for meat in meats))
    p = float(special.fdtrc(rank, scores.df[u], max(f, 0.0)))
    if p > critical or problem.levels.df(level) <= 0:
        return p
    moved = np.flatnonzero(np.any(columns != 0, axis=(1, 2)))
    # a shape that repeats in every replication is not a random walk, even if it is smooth in time
    spread = SPREAD if level == problem.levels.of_error else 1.0
    ratio = likelihood_ratio(problem.levels.walks(level), list(white.outputs[moved]), list(columns[moved]), spread)
    return max(p, float(special.chdtrc(rank, max(ratio, 0.0))))


def walked(problem: Problem, columns: FloatArray) -> FloatArray:
    """(q, q) contribution of the walk of the offsets to the covariance of columns' (S, n, q) products with the outputs.

    Every replication's offset is removed from the columns, so the walk may start again in each.
    """
    ahead = np.cumsum(columns[:, problem.levels.executed], axis=1)
    return np.asarray(np.einsum("s,snj,snk->jk", problem.wander, ahead, ahead))
