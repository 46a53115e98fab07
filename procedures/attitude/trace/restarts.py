"""Searches from other starts: what came in first may have stood in for several effects that were not yet in the model.

A search that adds the best one at a time can end in a crowd of effects that share what two or three explain better.
It is only begun again where a crowd was found; what the starts end in is compared as alias classes are, by what is left
and the price of the columns.
"""

from __future__ import annotations

import numpy as np

from fitter.arrays import FloatArray
from fitter.trace.aliases import PER_COLUMN
from fitter.trace.search import names_of, prune, search_and_name
from procedures.attitude.trace.judge import AttitudeJudge
from procedures.attitude.trace.score import beside, errors, score

CROWD = 3
"""Effects from which on a search is begun again."""
MOST_STARTS = 5
"""Other starts at most, those that explain most by themselves."""


def search_with_restarts(judge: AttitudeJudge) -> tuple[AttitudeJudge, tuple[int, ...]]:
    """The judge with its searched constants placed, and the best of what searches from several starts end in."""
    ends = [search_and_name(judge)]
    if len(names_of(judge.candidates, ends[0][1])) >= CROWD:
        ends += [search_and_name(judge, prune(judge, start)) for start in _starts(judge)]
    sigma = errors(ends[0][0].problem, ends[0][1])
    return min(ends, key=lambda end: _price(end[0], end[1], sigma))


def _starts(judge: AttitudeJudge) -> list[tuple[int, ...]]:
    """For effects that stand out beside nothing, the best unit in every sensor in which they do; strongest first."""
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
