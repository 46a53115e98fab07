"""Random walk of the offset through the run, in addition to the scatter of readings.

A random walk looks like temperature, like drift, like direction, and over a serpentine path even like the design. If
the residual shows one, every candidate is also tested against it; the remaining effects are those that a random walk
does not explain.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy import special

from rig.fitter import ties
from rig.fitter.arrays import FloatArray
from rig.fitter.trace.chance import ALPHA, counted
from rig.procedures.attitude.trace.problem import Problem
from rig.procedures.attitude.trace.score import errors
from rig.procedures.attitude.trace.view import View
from rig.procedures.attitude.trace.walks import STEPS, WIDE

SHORTEST = 16
"""Minimum number of observations of a replication for the test of a walk."""


def with_wander(problem: Problem, chosen: tuple[int, ...]) -> Problem:
    """The problem with the random walk of each sensor beside the `chosen` candidates, if it is significant."""
    level, count = problem.levels.of_error, len(problem.scene.data)
    if problem.levels.df(level) <= 0 or count // problem.scene.data.replicates.size < SHORTEST:
        return problem
    left = View(problem, level, chosen, errors(problem, chosen)).outputs
    found = [(counted(p, len(left)), step) for p, step in (walk_evidence(problem, one) for one in left)]
    return replace(problem, wander=np.array([step if p <= ALPHA else 0.0 for p, step in found]))


def walk_evidence(problem: Problem, left: FloatArray) -> tuple[float, float]:
    """P of such a random walk in one sensor's residual by chance, and its mean square step over its error's variance.

    Args:
        problem: the run.
        left: (n,) the residual at the level of the error, over that error.
    """
    level = problem.levels.of_error
    for steps in (STEPS, WIDE):
        walks = problem.levels.walks(level, wide=steps is WIDE)
        squares = walks.products(left[:, None])[:, 0, 0]
        likelihood = walks.log_likelihood(squares)
        best = ties.highest(likelihood)
        if best < len(STEPS) - 1:
            break
    p, step = 0.5 * float(special.chdtrc(1, 2.0 * (likelihood[best] - likelihood[0]))), steps[best]
    if 1 < best < len(steps) - 1:  # between the steps that are tried
        before, own, after = likelihood[best - 1 : best + 2].tolist()
        shift = 0.5 * (before - after) / min(before - 2.0 * own + after, -np.finfo(float).tiny)
        step *= float((steps[best + 1] / steps[best]) ** shift)
    return p, step * float(squares[best]) / walks.df
