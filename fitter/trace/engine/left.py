"""Rows of a sensor without their common errors, for the estimate of their noise."""

from __future__ import annotations

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.linear import orthonormal
from rig.fitter.trace.engine.judge import TableJudge


def left_of(judge: TableJudge, chosen: tuple[int, ...]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(n,) residuals without common errors of rows, share of variance in each, and the fitted response."""
    problem, at = judge.problem, judge.beside(chosen).best
    taken, white = judge.taken(at, chosen), judge.white(at, chosen)
    left = (white - taken @ (taken.T @ white)) * problem.sd
    basis = orthonormal(problem.model(chosen) / problem.sd[:, None])
    scaled = problem.y / problem.sd
    return left, 1.0 - np.sum(taken**2, axis=1), (basis @ (basis.T @ scaled)) * problem.sd
