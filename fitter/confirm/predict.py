"""Expected result of a planned run: separation of the explanations of an effect.

Many further runs are simulated, given the readings of the first one, and judged by the judge's own code. So the
forecast includes the parameters estimated again from the further run, the price of columns, and the own errors of
replications and whole plots.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fitter.arrays import FloatArray
from fitter.confirm.compare import Apart, Comparison
from fitter.confirm.draws import Could
from fitter.confirm.question import Question
from fitter.confirm.together import Together
from fitter.quantiles import DISTINGUISHED, t_limit

NOTHING = "nothing"
DRAWS = 200
INTERVAL = 0.05, 0.95
LEAST_OF_A_PAIR = 20
"""Minimum number of draws for each member, however unlikely it is by the first run."""

Pair = tuple[str, str]


@dataclass(frozen=True)
class Separation:
    """Expected separation of the explanations of one effect. The member `NOTHING` means: the effect of the first run is
    absent in the later one.

    Attributes:
        effect: the named one.
        sigmas: for each pair of members the median of the standard errors between them if one of them is true; each is
            true with its probability by the first run.
        intervals: 90 % intervals of these.
        chances: probability that the later run excludes the false one, or shows the true one.
    """

    effect: str
    sigmas: Mapping[Pair, float]
    intervals: Mapping[Pair, tuple[float, float]]
    chances: Mapping[Pair, float]

    @property
    def least(self) -> float:
        """Those of the nearest pair."""
        return min(self.sigmas.values())


def separation(both: Together | Sequence[Together], questions: Sequence[Question]) -> tuple[Separation, ...]:
    """Expectations for a planned run; its outputs are not used.

    Args:
        both: the first run and the planned one; or several equally probable courses of the planned one.
        questions: open questions.
    """
    ways = [both] if isinstance(both, Together) else list(both)
    return tuple(_separation(ways, question) for question in questions)


def _separation(ways: Sequence[Together], question: Question) -> Separation:
    limit, likely = t_limit(DISTINGUISHED, ways[0].df), Could(ways[0], question).likely
    counts = np.maximum(np.round(DRAWS / len(ways) * likely).astype(int), LEAST_OF_A_PAIR)
    told = [_drawn(ways, question, j, int(count)) for j, count in enumerate(counts)]
    counts *= len(ways)
    weight = likely / counts
    names = [member.effect for member in question.members]
    figures: dict[Pair, tuple[FloatArray, FloatArray, FloatArray]] = {}
    for i, j in itertools.combinations(range(len(names)), 2):
        one, other = _fallen(told[i], i, j, limit), _fallen(told[j], j, i, limit)
        weights = np.repeat([weight[i], weight[j]], [counts[i], counts[j]])
        values, excluded = (np.concatenate(both) for both in zip(one, other, strict=True))
        figures[names[i], names[j]] = values, excluded, weights
    for i, name in enumerate(names):
        figures[name, NOTHING] = told[i].shown[i], told[i].shown[i] >= limit, np.ones(counts[i])
    return Separation(
        question.effect,
        {pair: _quantile(f[0], f[2], 0.5) for pair, f in figures.items()},
        {pair: (_quantile(f[0], f[2], INTERVAL[0]), _quantile(f[0], f[2], INTERVAL[1])) for pair, f in figures.items()},
        {pair: float(np.average(f[1], weights=f[2])) for pair, f in figures.items()},
    )


def _drawn(ways: Sequence[Together], question: Question, member: int, count: int) -> Apart:
    """Results of the judge for this many runs of each course, if a member is true."""
    told = [Comparison(both, question).apart(Could(both, question).outputs(member, count)) for both in ways]
    return Apart(np.hstack([one.costs for one in told]), np.hstack([one.shown for one in told]))


def _fallen(apart: Apart, true: int, false: int, limit: float) -> tuple[FloatArray, FloatArray]:
    """(k,) standard errors between a true and a false member, and whether only the false one is excluded."""
    between = np.sqrt(np.abs(apart.costs[false] - apart.costs[true]))
    behind = apart.behind
    return between, (behind[false] > limit) & (behind[true] <= limit)


def _quantile(values: FloatArray, weights: FloatArray, level: float) -> float:
    order = np.argsort(values)
    reached = (np.cumsum(weights[order]) - 0.5 * weights[order]) / np.sum(weights)
    return float(np.interp(level, reached, values[order]))
