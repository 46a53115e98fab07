"""What the best of all candidates scores when there is nothing to find.

The family is every candidate on every sensor at every level and step of one run. It holds 5 % by being run at
3.5 %: most of it for the largest score of all, simulated under the fitted null; the rest for the tests between
replications, which have few degrees of freedom and are counted one by one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import special

from fitter.arrays import FloatArray
from fitter.trace.problem import Problem
from fitter.trace.score import NOTHING_LEFT, Scores, errors, whiten

ALPHA = 0.035
COUNTED = 1 / 7
"""Share of ALPHA kept for tests that are counted one by one: those between replications."""
DRAWS = 20_000


@dataclass(frozen=True, eq=False)
class Family:
    """Smallest of all p in `DRAWS` runs in which nothing is missing, ascending."""

    smallest_p: FloatArray

    @property
    def least(self) -> float:
        """What `adjust` gives for p smaller than all simulated: a bound, the value is at most that."""
        return float(self.adjust(0.0))

    def adjust(self, p: FloatArray | float) -> FloatArray:
        """Probability that the best of the family looks at least as good by chance; significant below `ALPHA`."""
        rank = np.searchsorted(self.smallest_p, p, side="right")
        return np.asarray(np.minimum((1.0 + rank) / (1.0 + self.smallest_p.size) / (1.0 - COUNTED), 1.0))


def family_of(problem: Problem, scores: Scores, seed: int) -> Family:
    """Simulate the family's smallest p under the null.

    Scores of one run are correlated as their columns are. They are drawn as normal, each group that shares an error
    over its own estimate of that error.
    """
    sigma = errors(problem, ())
    columns = np.zeros((problem.raw.shape[0] * problem.raw.shape[1], len(problem.candidates)))
    for level in ("replications", "points"):
        here = problem.at(level)
        columns[:, here] = whiten(problem, level, (), sigma, here).columns.reshape(len(columns), here.size)
    length = np.linalg.norm(columns, axis=0)
    raw = np.sqrt(np.sum((problem.length / sigma[:, None]) ** 2, axis=0))
    judged = length > NOTHING_LEFT * raw
    if not np.any(judged):
        return Family(np.ones(1))
    unit = columns[:, judged] / length[judged]
    values, vectors = np.linalg.eigh(unit.T @ unit)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    rng = np.random.default_rng(seed)
    z = np.abs(rng.standard_normal((DRAWS, root.shape[1]), dtype=np.float32) @ root.T.astype(np.float32))
    group = np.isin(np.flatnonzero(judged), problem.at("points"))
    smallest = np.ones(DRAWS)
    for members in (group, ~group):
        if not np.any(members):
            continue
        freedom = float(np.max(scores.df[judged][members]))
        estimated = np.sqrt(rng.chisquare(freedom, DRAWS) / freedom)
        best = z[:, members].max(axis=1) / estimated
        smallest = np.minimum(smallest, 2.0 * special.stdtr(freedom, -best))
    return Family(np.sort(smallest))
