"""Random walk of the offset through the run, in addition to the scatter of readings.

A random walk looks like temperature, like drift, like direction, and over a serpentine path even like the design. If
the residual shows one, every candidate is also tested against it; the remaining effects are those that a random walk
does not explain.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy import sparse, special

from rig.fitter.arrays import FloatArray, IntArray
from rig.procedures.attitude.trace.levels import stretches
from rig.procedures.attitude.trace.problem import Problem
from rig.procedures.attitude.trace.score import errors, whiten
from rig.procedures.attitude.trace.walks import STEPS

OBSERVATIONS = 24
"""Number of observations in one stretch: long enough to detect a slow walk in the scatter, short enough for many
stretches.
"""
STRETCHES = 4
"""Minimum number of stretches in a replication, if it is long enough."""
SHORTEST = 16
"""Minimum number of observations of a replication for the test of a walk."""
SURE = 3.0
"""Limit of the sums over stretches, in standard deviations of the null."""
DRAWS = 100
AT_ONCE = 20
SEED = 1


@dataclass(frozen=True, eq=False)
class Expected:
    """Remainders of white noise and of a random walk, both of unit size, at the level of the error.

    Attributes:
        stretch: (n,) index of each row's stretch.
        white: (2,) mean sum of squares, and mean sum of squared sums over stretches, of white noise.
        walk: (2,) the same for a random walk with unit steps per row.
        ratio_sd: sd of their quotient, for white noise.
    """

    stretch: IntArray
    white: FloatArray
    walk: FloatArray
    ratio_sd: float


def expected(problem: Problem) -> Expected | None:
    """Simulate both kinds of noise through the projection that residuals went through.

    None if no walk could be detected: without degrees of freedom, or in very short replications.
    """
    data, rng = problem.scene.data, np.random.default_rng(SEED)
    each = len(data) // data.replicates.size
    if problem.levels.df(problem.levels.of_error) <= 0 or each < SHORTEST:
        return None
    stretch = stretches(data, min(OBSERVATIONS, each // STRETCHES))
    white, walk = list[FloatArray](), list[FloatArray]()
    basis, means = problem.levels.taken(problem.levels.of_error)
    added = _added(stretch)
    added_basis, added_means = added @ basis, added @ means.T
    for _ in range(DRAWS // AT_ONCE):
        noise = rng.standard_normal((2, len(data), AT_ONCE))
        noise[1, problem.levels.executed] = np.cumsum(noise[1], axis=0)
        for out, one in zip((white, walk), noise, strict=True):
            along, mean = basis.T @ one, means @ one
            squares = [np.einsum("nq,nq->q", part, part) for part in (one, along, mean)]
            sums = added @ one - added_basis @ along - added_means @ mean
            out.append(np.stack([squares[0] - squares[1] - squares[2], np.einsum("nq,nq->q", sums, sums)]))
    sums = np.concatenate(white, axis=1)
    ratio = sums[1] / sums[0]
    return Expected(stretch, sums.mean(axis=1), np.mean(walk, axis=(0, 2)), float(ratio.std(ddof=1)))


def with_wander(problem: Problem, chosen: tuple[int, ...], by: Expected) -> Problem:
    """The problem with the remaining random walk of each sensor beside the `chosen` candidates, if any."""
    left = whiten(problem, problem.levels.of_error, chosen, errors(problem, chosen)).outputs
    return replace(problem, wander=_walk(left, by))


def walk_evidence(problem: Problem, left: FloatArray) -> tuple[float, float]:
    """P of such a random walk in one sensor's residual by chance, and its mean square step over the variance of
    scatter.

    Args:
        problem: the run.
        left: (n,) the residual at the level of the error.
    """
    walks = problem.levels.walks(problem.levels.of_error)
    likelihood = walks.log_likelihood(walks.products(left[:, None])[:, 0, 0])
    best = int(np.argmax(likelihood))
    return 0.5 * float(special.chdtrc(1, 2.0 * (likelihood[best] - likelihood[0]))), STEPS[best]


def _walk(left: FloatArray, by: Expected) -> FloatArray:
    """(S,) mean square step of the walk in the residual, zero if it is not detected."""
    squares, sums = _sums(left.T, by.stretch)
    squares = np.maximum(squares, np.finfo(float).tiny)
    standing_out = (sums / squares - by.white[1] / by.white[0]) / by.ratio_sd
    mix = np.linalg.solve(np.column_stack([by.white, by.walk]), np.stack([squares, sums]))
    return np.asarray(np.where(standing_out > SURE, np.maximum(mix[1], 0.0), 0.0))


def _sums(noise: FloatArray, stretch: IntArray) -> FloatArray:
    """(2, q) sum of squares, and sum of squared sums over stretches, of each column of `noise` (n, q)."""
    return np.stack([np.sum(noise**2, axis=0), np.sum(np.asarray(_added(stretch) @ noise) ** 2, axis=0)])


def _added(stretch: IntArray) -> Any:
    """(stretches, n) sparse matrix that adds rows up to stretches."""
    return sparse.csr_array((np.ones(stretch.size), (stretch, np.arange(stretch.size))))
