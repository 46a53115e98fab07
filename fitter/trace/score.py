"""How much each candidate removes beyond the present model, against the error of its own stratum.

Outputs are divided by their own point-by-replication error, so that sensors count alike. A candidate's score is its
coefficient over the largest of its standard errors:

- from the point-by-replication error; between points from the lack of fit instead, wherever more than error is left
  there after the candidate, so that an unknown cause cannot bring in whatever slightly resembles it;
- from the scatter of each observation's own contribution, which holds for unequal variances and for head errors that
  several sensors share;
- for what varies in time, from the scatter over stretches of the run, which holds where the noise wanders slowly;
- from a random walk of the offset, where the residual shows one (`wander.py`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special

from fitter.arrays import FloatArray, IntArray
from fitter.linear import orthonormal
from fitter.quantiles import f_limit
from fitter.trace.levels import Level
from fitter.trace.problem import Problem
from fitter.trace.whitened import Whitened

NOTHING_LEFT = 1e-3
"""A candidate of which less than this share is left beside the others at its level cannot be judged there."""


RESOLVED = 1e-12
"""Of an output's swing: what is smaller than this is rounding, and data without noise are not tested against it."""


@dataclass(frozen=True, eq=False)
class Scores:
    """One entry a candidate, (J,); zero and one where a candidate is in the model or cannot be judged.

    Attributes:
        t: score in standard errors.
        df: degrees of freedom of the error it was judged against.
        p: probability of a larger score by chance, this candidate taken alone.
        gain: fall of the residual sum of squares, in units of the error's variance.

    """

    t: FloatArray
    df: FloatArray
    p: FloatArray
    gain: FloatArray


def errors(problem: Problem, chosen: Sequence[int]) -> FloatArray:
    """(S,) point-by-replication standard error of each sensor beside the `chosen` candidates, V.

    Without replications the residual of the model stands in for it.
    """
    level: Level = "points" if problem.levels.df("points") > 0 else "declared"
    own, y = problem.columns[level][:, :, list(chosen)], problem.outputs[level]
    sigma = np.empty(len(problem.sensors))
    for i in range(len(sigma)):
        basis = orthonormal(own[i], problem.length[i, list(chosen)], NOTHING_LEFT)
        left = y[i] - basis @ (basis.T @ y[i])
        df = problem.levels.df(level) - basis.shape[1]
        sigma[i] = np.sqrt(np.sum(left**2) / df) if df > 0 else np.nan
    return np.asarray(np.maximum(sigma, rounding(problem)))


def rounding(problem: Problem) -> FloatArray:
    """(S,) volts below which a residual is rounding and no error."""
    swing = np.array([np.ptp(problem.scene.data.outputs[s]) for s in problem.sensors])
    return np.asarray(RESOLVED * np.maximum(swing, 1.0))


def whiten(
    problem: Problem, level: Level, chosen: Sequence[int], sigma: FloatArray, of: Sequence[int] | IntArray | None = None
) -> Whitened:
    """Outputs and columns over `sigma` (S,), with the `chosen` candidates fitted and taken out of both.

    Args:
        problem: the run.
        level: what else is taken out.
        chosen: candidates in the model.
        sigma: (S,) error of each sensor, V.
        of: the candidates whose columns are wanted; all of them if left out.

    """
    block = problem.columns[level]
    picked, wanted = list(chosen), slice(None) if of is None else np.asarray(of, np.int64)
    scale = sigma[:, None]
    length = np.linalg.norm(problem.length[:, picked] / scale, axis=0)
    taken, columns = block[:, :, picked] / scale[:, :, None], block[:, :, wanted] / scale[:, :, None]
    return Whitened(problem.outputs[level] / scale, columns).beside(taken, length)


def score(problem: Problem, chosen: Sequence[int], of: Sequence[int] | None = None) -> Scores:
    """Score candidates beside the `chosen` ones, each at the level it is judged at.

    Args:
        problem: the run.
        chosen: candidates in the model.
        of: the candidates to be scored; all of them if left out.

    """
    count = len(problem.candidates)
    t, df, gain = np.zeros(count), np.ones(count), np.zeros(count)
    sigma = errors(problem, chosen)
    levels: tuple[Level, ...] = ("replications", "points")
    for level in levels:
        here = problem.at(level) if of is None else np.intersect1d(problem.at(level), of)
        if not here.size or problem.levels.df(level) <= len(chosen) + 1:
            continue
        white = whiten(problem, level, chosen, sigma, here)
        norm2, dot = np.sum(white.columns**2, axis=1), np.einsum("snj,sn->sj", white.columns, white.outputs)
        length2 = np.sum((problem.length[:, here] / sigma[:, None]) ** 2, axis=0)
        can = (norm2.sum(axis=0) > NOTHING_LEFT**2 * length2) & ~np.isin(here, chosen)
        gamma = np.where(can, dot.sum(axis=0), 0.0) / np.where(can, norm2.sum(axis=0), 1.0)
        after = np.sum(white.outputs**2, axis=1)[:, None] - 2 * gamma * dot + gamma**2 * norm2
        inflation, df[here] = _lack_of_fit(problem, level, chosen, after, norm2, sigma)
        variance = np.maximum(
            np.sum(norm2 * inflation, axis=0) + walked(problem, white.columns),
            _scatter(problem, level, white, gamma),
        )
        t[here] = gamma * norm2.sum(axis=0) / np.sqrt(np.where(can, variance, 1.0))
        gain[here] = gamma * dot.sum(axis=0)
    return Scores(t, df, 2.0 * special.stdtr(df, -np.abs(t)), gain)


def walked(problem: Problem, columns: FloatArray) -> FloatArray:
    """(J,) what the random walk in the offsets adds to the variance of columns' (S, n, J) products with the outputs.

    The columns are free of every replication's offset, so the walk may start anew in each.
    """
    if not np.any(problem.wander):
        return np.zeros(columns.shape[2])
    ahead = np.cumsum(columns[:, problem.levels.executed], axis=1)
    return np.asarray(problem.wander @ np.sum(ahead**2, axis=1))


def _scatter(problem: Problem, level: Level, white: Whitened, gamma: FloatArray) -> FloatArray:
    """(J,) variance of each column's product with the outputs, from the scatter of what observations contribute."""
    own = np.sum(white.columns * (white.outputs[:, :, None] - gamma * white.columns), axis=0)
    single = np.sum(own**2, axis=0)
    if level != "points":
        return np.asarray(single)
    by_stretch = np.zeros((int(problem.levels.stretch.max()) + 1, own.shape[1]))
    np.add.at(by_stretch, problem.levels.stretch, own)
    return np.asarray(np.maximum(single, np.sum(by_stretch**2, axis=0)))


def _lack_of_fit(
    problem: Problem, level: Level, chosen: Sequence[int], after: FloatArray, norm2: FloatArray, sigma: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """What candidates are judged against: pure error, or the lack of fit where more than error is left.

    Args:
        problem: the run.
        level: at which they are judged.
        chosen: candidates in the model.
        after: (S, J) residual sum of squares beside each candidate, over each sensor's error.
        norm2: (S, J) squared length of the candidates' columns.
        sigma: (S,) error of each sensor, V.

    Returns:
        (S, J) mean square of that error over the pure error's, and (J,) its degrees of freedom.

    """
    count, j = norm2.shape
    pure, plain = problem.levels.df("points"), np.ones((count, j))
    if pure <= 0:
        return plain, np.full(j, float(problem.levels.df(level) - len(chosen) - 1))
    lof = problem.levels.n_points - problem.levels.declared.shape[1] - len(chosen) - 1
    if level == "points" or lof <= 0:
        return plain, np.full(j, float(pure * count))
    within = np.sum(whiten(problem, "points", chosen, sigma, ()).outputs ** 2, axis=1)
    ratio = (after - within[:, None]) / lof
    inflation = np.where(ratio > f_limit(0.95, lof, pure), ratio, 1.0)
    concerned = norm2 > 0.05 * norm2.sum(axis=0)
    return inflation, np.where(np.any((inflation > 1.0) & concerned, axis=0), float(lof), float(pure * count))
