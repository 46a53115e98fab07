"""Forward and backward search: add the best, refit all, drop what is no longer needed, until nothing stands out."""

from __future__ import annotations

import numpy as np

from fitter.arrays import FloatArray
from fitter.effects import Stratum
from fitter.trace.estimate import coefficients
from fitter.trace.family import ALPHA, FOR_REPLICATIONS, Family
from fitter.trace.problem import Problem
from fitter.trace.replications import p_between_replications
from fitter.trace.score import score

MOST = 16
"""Terms after which a search is given up: the declared model is not a model of these data."""


def search(problem: Problem, family: Family, start: tuple[int, ...] = ()) -> tuple[int, ...]:
    """Indices of the candidates that belong in the model, in the order found, from `start` on."""
    chosen, seen = start, {frozenset(start)}
    while len(chosen) < MOST:
        best = _best(problem, family, chosen)
        if best is None:
            break
        chosen = prune(problem, family, (*chosen, best))
        if frozenset(chosen) in seen:
            break
        seen.add(frozenset(chosen))
    return chosen


def prune(problem: Problem, family: Family, chosen: tuple[int, ...]) -> tuple[int, ...]:
    """`chosen` without those that are not significant beside the others, the weakest dropped first."""
    while chosen:
        p = [p_adjusted(problem, family, chosen, j) for j in chosen]
        weakest = int(np.argmax(p))
        if p[weakest] <= ALPHA:
            break
        chosen = chosen[:weakest] + chosen[weakest + 1 :]
    return chosen


def p_adjusted(problem: Problem, family: Family, chosen: tuple[int, ...], j: int) -> float:
    """Probability that the best of the family looks as good as `j` beside the other `chosen` by chance."""
    others = tuple(k for k in chosen if k != j)
    p = float(family.adjust(score(problem, others, (j,)).p[j]))
    return p if p <= ALPHA else min(p, float(_between(problem, others)[j]))


def stratum_of(problem: Problem, family: Family, chosen: tuple[int, ...], j: int) -> Stratum:
    """The stratum in which `j` stands out beside the other `chosen`."""
    others = tuple(k for k in chosen if k != j)
    if float(family.adjust(score(problem, others, (j,)).p[j])) > ALPHA:
        return "replication"
    return "point-by-replication" if problem.judged_at[j] == "points" else "between-point"


def _best(problem: Problem, family: Family, chosen: tuple[int, ...]) -> int | None:
    if not problem.candidates:
        return None
    scores = score(problem, chosen)
    found = np.flatnonzero(family.adjust(scores.p) <= ALPHA)
    if found.size:
        return int(found[np.argmax(scores.gain[found])])
    between = _between(problem, chosen)
    best = int(np.argmin(between))
    return best if between[best] <= ALPHA else None


def _between(problem: Problem, chosen: tuple[int, ...]) -> FloatArray:
    """(J,) p between replications, each multiplied by the number of tests over their share of the family."""
    p = p_between_replications(problem, chosen, coefficients(problem, chosen, "declared")[0])
    tests = max(int(np.sum(p < 1.0)), 1)
    return np.asarray(np.minimum(p * tests / FOR_REPLICATIONS, 1.0))
