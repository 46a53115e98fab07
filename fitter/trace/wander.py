"""Noise that wanders: an offset that takes a random walk through the run, beside the scatter of the readings.

A random walk looks like temperature, like drift, like direction, and over a serpentine path even like the design.
Where the residual shows one, every candidate is judged against it too; the effects that remain are those a random
walk does not explain.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky_banded, solve_banded

from fitter.arrays import FloatArray, IntArray
from fitter.trace.levels import stretches
from fitter.trace.problem import Problem
from fitter.trace.score import errors, whiten

OBSERVATIONS = 24
"""In one stretch: long enough for a slow walk to stand out of the scatter, short enough to have many."""
STRETCHES = 4
"""At least, in a replication, if it is long enough for that."""
SHORTEST = 16
"""Observations of a replication below which no walk is looked for."""
SURE = 3.0
"""Standard deviations of the null by which the sums over stretches must be too large."""
MARGIN = 3.0
"""Natural log of the likelihood ratio that effects in time need over a random walk."""
STEPS = tuple(np.logspace(-6, 0, 13))
"""Mean square steps of a walk tried, over the variance of the scatter."""
DRAWS = 100
SEED = 1


@dataclass(frozen=True, eq=False)
class Expected:
    """What white noise and a random walk, both of unit size, leave at the level "points".

    Attributes:
        stretch: (n,) which stretch a row belongs to.
        white: (2,) mean sum of squares, and mean sum of squared sums over stretches, of white noise.
        walk: (2,) the same of a random walk that moves by one a row.
        ratio_sd: sd of their quotient, for white noise.

    """

    stretch: IntArray
    white: FloatArray
    walk: FloatArray
    ratio_sd: float


def expected(problem: Problem) -> Expected | None:
    """Simulate both kinds of noise through the projection that residuals went through.

    None where no walk could be seen: without replications, or in very short ones.
    """
    data, rng = problem.scene.data, np.random.default_rng(SEED)
    each = len(data) // data.replicates.size
    if problem.levels.df("points") <= 0 or each < SHORTEST:
        return None
    stretch = stretches(data, min(OBSERVATIONS, each // STRETCHES))
    white = rng.standard_normal((len(data), DRAWS))
    walk = np.empty_like(white)
    walk[problem.levels.executed] = np.cumsum(rng.standard_normal((len(data), DRAWS)), axis=0)
    left = [_sums(problem.levels.leave(noise, "points"), stretch) for noise in (white, walk)]
    ratio = left[0][1] / left[0][0]
    return Expected(stretch, left[0].mean(axis=1), left[1].mean(axis=1), float(ratio.std(ddof=1)))


def with_wander(problem: Problem, chosen: tuple[int, ...], by: Expected) -> Problem:
    """The problem with the random walk that is left in each sensor beside the `chosen` candidates, if any is."""
    sigma = errors(problem, chosen)
    left = whiten(problem, "points", chosen, sigma, ()).outputs
    found = _walk(left, by)
    in_time = tuple(j for j in chosen if problem.judged_at[j] == "points")
    if in_time:
        bare = whiten(problem, "points", [j for j in chosen if j not in in_time], sigma, ()).outputs
        instead = np.array([likelier_a_walk(*pair, problem) for pair in zip(bare, left, strict=True)])
        found = np.where(instead, np.maximum(found, _walk(bare, by)), found)
    return replace(problem, wander=found)


def likelier_a_walk(bare: FloatArray, left: FloatArray, problem: Problem) -> bool:
    """Whether a random walk explains `bare` (n,) better than scatter alone explains `left` (n,).

    `left` is what effects in time leave of `bare`. A walk that explains a smooth effect has to be wide enough to take
    many other courses too, and its likelihood pays for them.
    """
    firsts = np.diff(problem.scene.data.replicate_index[problem.levels.executed]) != 0
    scatter, walk = (np.diff(e[problem.levels.executed]) for e in (left, bare))
    best = max(_log_likelihood(walk, firsts, step) for step in STEPS)
    return best > _log_likelihood(scatter, firsts, 0.0) - MARGIN


def _log_likelihood(moves: FloatArray, firsts: NDArray[np.bool_], step: float) -> float:
    """Of differences between consecutive observations: scatter, plus a walk of mean square `step` over its variance.

    The differences' covariance has three diagonals; those across the start of a replication say nothing.
    """
    moves = np.where(firsts, 0.0, moves)
    below = np.where(firsts[:-1] | firsts[1:], 0.0, -1.0)
    factor = cholesky_banded(np.stack([np.where(firsts, 1.0, 2.0 + step), np.append(below, 0.0)]), lower=True)
    count = moves.size - int(firsts.sum())
    white = solve_banded((1, 0), factor, moves)
    return float(-0.5 * count * np.log(np.sum(white**2) / count) - np.sum(np.log(factor[0])))


def _walk(left: FloatArray, by: Expected) -> FloatArray:
    """(S,) mean square step of the walk in what is left, zero where there may be none."""
    squares, sums = _sums(left.T, by.stretch)
    squares = np.maximum(squares, np.finfo(float).tiny)
    standing_out = (sums / squares - by.white[1] / by.white[0]) / by.ratio_sd
    mix = np.linalg.solve(np.column_stack([by.white, by.walk]), np.stack([squares, sums]))
    return np.asarray(np.where(standing_out > SURE, np.maximum(mix[1], 0.0), 0.0))


def _sums(noise: FloatArray, stretch: IntArray) -> FloatArray:
    """(2, q) sum of squares, and sum of squared sums over stretches, of each column of `noise` (n, q)."""
    by_stretch = np.zeros((int(stretch.max()) + 1, noise.shape[1]))
    np.add.at(by_stretch, stretch, noise)
    return np.stack([np.sum(noise**2, axis=0), np.sum(by_stretch**2, axis=0)])
