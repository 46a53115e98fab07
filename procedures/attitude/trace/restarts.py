"""Searches from other starts: the first candidate may have replaced several effects that were not yet in the model.

A search that adds one candidate at a time can end with many effects in place of two or three better ones. It is
repeated only in such a case. The results are compared like alias classes, by residual and price of the columns.
"""

from __future__ import annotations

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.trace.aliases import PER_COLUMN, ROUNDING
from rig.fitter.trace.search import names_of, prune, search_and_name
from rig.procedures.attitude.trace.judge import AttitudeJudge
from rig.procedures.attitude.trace.score import beside, errors, score

CROWD = 3
"""Minimum number of effects for a repeated search."""
MOST_STARTS = 5
"""Maximum number of other starts, those with the largest gain alone."""


def search_with_restarts(judge: AttitudeJudge) -> tuple[AttitudeJudge, tuple[int, ...]]:
    """The judge with refined constants, and the best result of searches from several starts."""
    ends = [search_and_name(judge)]
    if len(names_of(judge.candidates, ends[0][1])) >= CROWD:
        ends += [search_and_name(judge, prune(judge, start)) for start in _starts(judge)]
    sigma = errors(ends[0][0].problem, ends[0][1])
    prices = np.array([_price(*end, sigma) for end in ends])
    return ends[int(np.argmax(prices <= prices.min() * (1.0 + ROUNDING)))]


def _starts(judge: AttitudeJudge) -> list[tuple[int, ...]]:
    """For each effect significant by itself, the best unit in every such sensor; strongest first."""
    problem = judge.problem
    scores = score(problem, ())
    best: dict[str, dict[str | None, int]] = {}
    for u in np.flatnonzero((scores.p <= judge.family.critical) & judge.possible(scores)).tolist():
        name, sensor = problem.candidates[problem.units[u][0]].cause
        of = best.setdefault(name, {})
        if sensor not in of or scores.gain[u] > scores.gain[of[sensor]]:
            of[sensor] = u
    strongest = sorted(best.values(), key=lambda of: -sum(scores.gain[u] for u in of.values()))
    return [tuple(j for u in of.values() for j in problem.units[u]) for of in strongest[:MOST_STARTS]]


def _price(judge: AttitudeJudge, chosen: tuple[int, ...], sigma: FloatArray) -> float:
    left = beside(judge.problem, "replications", chosen, np.zeros(0, np.int64), sigma).square
    return float(left.sum()) + PER_COLUMN * (
        len(chosen) + len(judge.searched & set(names_of(judge.candidates, chosen)))
    )
