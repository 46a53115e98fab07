"""What the best of all candidates scores on a whole-plot run when there is nothing to find."""

from __future__ import annotations

import numpy as np
from scipy import special

from fitter.arrays import FloatArray
from fitter.linear import orthonormal
from fitter.trace.family import DRAWS, Family
from fitter.trace.whole_plots.problem import Problem
from fitter.trace.whole_plots.score import NOTHING_LEFT, beside
from fitter.trace.whole_plots.strata import LEVELS, Level


def family_of(problem: Problem, seed: int) -> Family:
    """Simulate the family's smallest p under the null, both strata and all transducers together.

    What noise does to the candidates' columns and the noise beside them are drawn together, so that few degrees of
    freedom for whole plots' errors are allowed for exactly. Transducers are drawn as independent: if they share errors
    there are fewer chances, and the family holds less than its level.
    """
    rng = np.random.default_rng(seed)
    smallest = np.ones(DRAWS)
    for level in LEVELS:
        smallest = np.minimum(smallest, _smallest(problem, level, rng))
    return Family(np.sort(smallest))


def _smallest(problem: Problem, level: Level, rng: np.random.Generator) -> FloatArray:
    """(DRAWS,) smallest p of one stratum."""
    here, df = problem.within(level), problem.at[level].df
    stratum = beside(problem, level, (), here)
    columns, length = stratum.white.columns, problem.length_at[level][:, here] / stratum.sigma[:, None]
    norm = np.linalg.norm(columns, axis=(0, 1))
    judged = norm > NOTHING_LEFT * np.linalg.norm(length, axis=0)
    if not np.any(judged) or np.min(df) <= 1:
        return np.ones(DRAWS)
    unit, line = columns[:, :, judged] / norm[judged], np.array([problem.candidates[j].sensor is None for j in here])
    sums, squares = np.zeros((DRAWS, int(judged.sum()))), np.zeros((len(df), DRAWS))
    for i, own in enumerate(unit):
        basis = orthonormal(own, tolerance=1e-6)
        z = rng.standard_normal((DRAWS, basis.shape[1]), dtype=np.float32)
        sums += z @ (basis.T @ own).astype(np.float32)
        rest = max(df[i] - basis.shape[1], 0.0)
        squares[i] = np.sum(z**2, axis=1) + (rng.chisquare(rest, DRAWS) if rest > 0 else 0.0)
    smallest = np.ones(DRAWS)
    for i in range(-1, len(df)):
        members = line[judged] if i < 0 else np.linalg.norm(unit[i], axis=0) * ~line[judged] > 0
        if not np.any(members):
            continue
        total, freedom = (squares.sum(axis=0), df.sum()) if i < 0 else (squares[i], df[i])
        largest = np.max(np.abs(sums[:, members]), axis=1)
        error = np.sqrt(np.maximum(total - largest**2, np.finfo(float).tiny) / (freedom - 1.0))
        judged_with = (float(df.min()) if i < 0 else float(freedom)) - 1.0
        smallest = np.minimum(smallest, 2.0 * special.stdtr(judged_with, -largest / error))
    return smallest
