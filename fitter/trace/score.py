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

NOTHING_LEFT = 1e-3
"""A candidate of which less than this share is left beside the others at its level cannot be judged there."""


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


@dataclass(frozen=True, eq=False)
class Whitened:
    """What the chosen candidates leave at one level, over each sensor's own error.

    Attributes:
        outputs: (S, n).
        columns: (S, n, J).

    """

    outputs: FloatArray
    columns: FloatArray


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
    return np.maximum(sigma, np.finfo(float).tiny)


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
    block, (count, n, _) = problem.columns[level], problem.raw.shape
    picked, wanted = list(chosen), slice(None) if of is None else np.asarray(of, np.int64)
    taken = (block[:, :, picked] / sigma[:, None, None]).reshape(count * n, len(picked))
    basis = orthonormal(taken, np.linalg.norm(problem.length[:, picked] / sigma[:, None], axis=0), 1e-6)
    columns, outputs = block[:, :, wanted] / sigma[:, None, None], problem.outputs[level] / sigma[:, None]
    if basis.shape[1]:
        flat = columns.reshape(count * n, columns.shape[2])
        columns = (flat - basis @ (basis.T @ flat)).reshape(columns.shape)
        outputs = (outputs.reshape(-1) - basis @ (basis.T @ outputs.reshape(-1))).reshape(outputs.shape)
    return Whitened(outputs, columns)


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
        columns, e = white.columns, white.outputs
        norm2, dot = np.sum(columns**2, axis=1), np.einsum("snj,sn->sj", columns, e)
        raw2 = np.sum((problem.length[:, here] / sigma[:, None]) ** 2, axis=0)
        can = (norm2.sum(axis=0) > NOTHING_LEFT**2 * raw2) & ~np.isin(here, chosen)
        gamma = dot.sum(axis=0) / np.where(can, norm2.sum(axis=0), 1.0)
        inflation, df_here = _lack_of_fit(problem, level, chosen, norm2, dot, gamma, e, sigma)
        own = np.sum(columns * (e[:, :, None] - gamma * columns), axis=0)
        variance = np.sum(norm2 * inflation, axis=0) + walked(problem, columns)
        variance = np.maximum(variance, np.sum(own**2, axis=0))
        if level == "points":
            by_stretch = np.zeros((int(problem.levels.stretch.max()) + 1, here.size))
            np.add.at(by_stretch, problem.levels.stretch, own)
            variance = np.maximum(variance, np.sum(by_stretch**2, axis=0))
        t[here] = np.where(can, dot.sum(axis=0) / np.sqrt(np.where(can, variance, 1.0)), 0.0)
        gain[here] = np.where(can, dot.sum(axis=0) * gamma, 0.0)
        df[here] = df_here
    return Scores(t, df, 2.0 * special.stdtr(df, -np.abs(t)), gain)


def walked(problem: Problem, columns: FloatArray) -> FloatArray:
    """(J,) what the random walk in the offsets adds to the variance of columns' (S, n, J) products with the outputs.

    The columns are free of every replication's offset, so the walk may start anew in each.
    """
    if not np.any(problem.wander):
        return np.zeros(columns.shape[2])
    ahead = np.cumsum(columns[:, problem.levels.executed], axis=1)
    return np.asarray(problem.wander @ np.sum(ahead**2, axis=1))


def _lack_of_fit(
    problem: Problem,
    level: Level,
    chosen: Sequence[int],
    norm2: FloatArray,
    dot: FloatArray,
    gamma: FloatArray,
    e: FloatArray,
    sigma: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """(S, J) mean square left between points after each candidate over the error, one where it is no more than
    error; and (J,) degrees of freedom of what the candidate is judged against.
    """
    df_error = problem.levels.df("points")
    plain = np.full(norm2.shape[1], float(max(df_error, problem.levels.df(level) - len(chosen) - 1)))
    inflation = np.ones_like(norm2)
    if df_error <= 0 or level == "points":
        return inflation, plain if df_error <= 0 else np.full_like(plain, df_error * len(sigma))
    within = np.sum(whiten(problem, "points", chosen, sigma, ()).outputs ** 2, axis=1)
    df_lof = problem.levels.n_points - problem.levels.declared.shape[1] - len(chosen) - 1
    if df_lof <= 0:
        return inflation, np.full_like(plain, df_error * len(sigma))
    after = np.sum(e**2, axis=1)[:, None] - 2 * gamma * dot + gamma**2 * norm2
    ratio = (after - within[:, None]) / df_lof
    inflation = np.where(ratio > f_limit(0.95, df_lof, df_error), ratio, 1.0)
    worst = np.any((inflation > 1.0) & (norm2 > 0.05 * norm2.sum(axis=0)), axis=0)
    return inflation, np.where(worst, float(df_lof), float(df_error * len(sigma)))
