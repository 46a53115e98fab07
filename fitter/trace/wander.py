"""Noise that wanders: an offset that takes a random walk through the run, beside the scatter of the readings.

A random walk looks like temperature, like drift, like direction, and over a serpentine path even like the design.
Where the residual shows one, every candidate is judged against it too; the effects that remain are those a random
walk does not explain.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import special
from scipy.linalg import cholesky_banded, solve_banded

from fitter.arrays import FloatArray, IntArray
from fitter.trace.levels import stretches
from fitter.trace.problem import Problem
from fitter.trace.score import errors, whiten
from fitter.trace.whitened import Whitened

OBSERVATIONS = 24
"""In one stretch: long enough for a slow walk to stand out of the scatter, short enough to have many."""
STRETCHES = 4
"""At least, in a replication, if it is long enough for that."""
SHORTEST = 16
"""Observations of a replication below which no walk is looked for."""
SURE = 3.0
"""Standard deviations of the null by which the sums over stretches must be too large."""
STEPS = (0.0, *np.logspace(-6, 0, 13).tolist())
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
    left = whiten(problem, "points", chosen, errors(problem, chosen)).outputs
    return replace(problem, wander=_walk(left, by))


def likelihood_ratio(problem: Problem, white: Whitened, gamma: FloatArray) -> float:
    """Twice the logarithm of how much likelier outputs are with some columns than without, a random walk beside both.

    The walk of each sensor is as wide as makes the outputs likeliest, with the columns and without: what a walk explains
    as well as the columns gives them no credit. Chi squared where there is nothing but scatter and a walk.

    Args:
        problem: the run.
        white: outputs (S, n) and columns (S, n, q) at the level "points".
        gamma: (q,) coefficients to start from.

    """
    rows = problem.levels.executed
    moved = np.any(white.columns != 0, axis=(1, 2))
    white = Whitened(white.outputs[moved], white.columns[moved])
    firsts = np.diff(problem.scene.data.replicate_index[rows]) != 0
    both = np.concatenate([white.outputs[:, :, None], white.columns], axis=2)[:, rows]
    moves = np.where(firsts[:, None], 0.0, np.diff(both, axis=1))
    count = firsts.size - int(firsts.sum())
    squares, determinant = _filtered(moves, firsts)

    def likelihood(coefficients: FloatArray) -> FloatArray:
        combined = np.concatenate([[1.0], -coefficients])
        rss = np.maximum(np.einsum("j,tsjk,k->ts", combined, squares, combined), np.finfo(float).tiny)
        return np.asarray(-0.5 * count * np.log(rss / count) - determinant[:, None])

    without, at = likelihood(np.zeros_like(gamma)).max(axis=0), np.arange(len(white.outputs))
    for _ in range(2):
        step = likelihood(gamma).argmax(axis=0)
        picked = squares[step, at]
        combined = np.concatenate([[1.0], -gamma])
        weight = 1.0 / np.maximum(np.einsum("j,sjk,k->s", combined, picked, combined), np.finfo(float).tiny)
        total = np.einsum("s,sjk->jk", weight, picked)
        gamma = np.linalg.lstsq(total[1:, 1:], total[1:, 0], rcond=1e-9)[0]
    return float(2.0 * np.sum(likelihood(gamma)[step, at] - without))


def walk_evidence(problem: Problem, left: FloatArray) -> tuple[float, float]:
    """P of so likely a random walk in one sensor's residual by chance, and its mean square step over the scatter's.

    Args:
        problem: the run.
        left: (n,) the residual at the level "points".

    """
    rows = problem.levels.executed
    firsts = np.diff(problem.scene.data.replicate_index[rows]) != 0
    moves = np.where(firsts, 0.0, np.diff(left[rows]))[None, :, None]
    count = max(firsts.size - int(firsts.sum()), 1)
    squares, determinant = _filtered(moves, firsts)
    rss = np.maximum(squares[:, 0, 0, 0], np.finfo(float).tiny)
    likelihood = -0.5 * count * np.log(rss / count) - determinant
    best = int(np.argmax(likelihood))
    return 0.5 * float(special.chdtrc(1, 2.0 * (likelihood[best] - likelihood[0]))), STEPS[best]


def _filtered(moves: FloatArray, firsts: NDArray[np.bool_]) -> tuple[FloatArray, FloatArray]:
    """Products (T, S, q, q) of differences between consecutive observations, made white for each of T widths of a walk.

    Scatter and a walk of mean square `step` over its variance give differences a covariance of three diagonals; those
    across the start of a replication say nothing. With it (T,) half the logarithm of the covariance's determinant.
    """
    sensors, n, q = moves.shape
    flat = np.moveaxis(moves, 0, 1).reshape(n, sensors * q)
    below = np.append(np.where(firsts[:-1] | firsts[1:], 0.0, -1.0), 0.0)
    squares, determinant = np.empty((len(STEPS), sensors, q, q)), np.empty(len(STEPS))
    for k, step in enumerate(STEPS):
        factor = cholesky_banded(
            np.stack([np.where(firsts, 1.0, 2.0 + step), below]), lower=True, overwrite_ab=True, check_finite=False
        )
        white = solve_banded((1, 0), factor, flat, check_finite=False).reshape(n, sensors, q)
        by_sensor = np.moveaxis(white, 1, 0)
        squares[k] = np.swapaxes(by_sensor, 1, 2) @ by_sensor
        determinant[k] = np.sum(np.log(factor[0]))
    return squares, determinant


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
