"""What stands out of an attitude run, over both of its tests: of single observations, and between replications."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from fitter.arrays import FloatArray
from fitter.effects import Stratum
from fitter.trace.aliases import Products, Rival, rivals
from fitter.trace.estimate import coefficients, concerns, estimate
from fitter.trace.family import ALPHA, COUNTED, Family
from fitter.trace.problem import Candidate, Problem
from fitter.trace.refine import refined
from fitter.trace.replications import p_between_replications
from fitter.trace.robust import second_thoughts
from fitter.trace.score import Scores, beside, errors, score

TOGETHER = 0.05
"""P between replications above which what happens within them is not asked for: together they would be too much."""


@dataclass(frozen=True, eq=False)
class AttitudeJudge:
    """A `fitter.trace.search.Judge` of pitch-roll runs."""

    problem: Problem
    family: Family

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """All there are, in catalogue order."""
        return self.problem.candidates

    @cached_property
    def searched(self) -> frozenset[str]:
        """Effects whose units are values of one constant."""
        return frozenset(c.effect.name for c in self.candidates if c.effect.searched)

    def unit(self, j: int) -> tuple[int, ...]:
        """Candidates that are judged together with `j`, itself among them."""
        return self.problem.units[self.problem.unit_of[j]]

    def refined(self, chosen: tuple[int, ...]) -> AttitudeJudge:
        """With the searched constants of what is `chosen` placed more closely."""
        problem = refined(self.problem, chosen)
        return self if problem is self.problem else replace(self, problem=problem)

    def best(self, chosen: tuple[int, ...]) -> tuple[int, ...]:
        """The unit that removes most beside those `chosen`, of those that stand out."""
        if not self.candidates:
            return ()
        scores = score(self.problem, chosen)
        found = np.flatnonzero(scores.p <= self.family.critical)
        for u in found[np.argsort(-scores.gain[found])].tolist():
            if self._again(chosen, u, scores) <= ALPHA:
                return self.problem.units[u]
        between = self._between(chosen)
        best = int(np.argmin(between))
        return self.problem.units[best] if between[best] <= ALPHA else ()

    def p_adjusted(self, chosen: tuple[int, ...], j: int) -> float:
        """Probability that the best of the family looks as good as `j`'s unit beside the other `chosen` by chance."""
        p = self._p_here(chosen, j)
        return p if p <= ALPHA else min(p, float(self._between(self._others(chosen, j))[self.problem.unit_of[j]]))

    def stratum_of(self, chosen: tuple[int, ...], j: int) -> Stratum:
        """The stratum in which `j` stands out beside the other `chosen`."""
        if self._p_here(chosen, j) > ALPHA:
            return "replication"
        return "point-by-replication" if self.problem.judged_at[j] == "points" else "between-point"

    def rivals(self, chosen: tuple[int, ...], effect: str) -> tuple[Rival, ...]:
        """All explanations of what the terms of `effect` among `chosen` explain, where coefficients are estimated."""
        problem = self.problem
        group = tuple(j for j in chosen if problem.candidates[j].effect.name == effect)
        rest = tuple(j for j in chosen if j not in group)
        every = np.arange(len(problem.candidates))
        sigma = errors(problem, chosen)
        left = beside(problem, estimate(problem, chosen).level, rest, every, sigma)
        length2 = np.sum((problem.length / sigma[:, None]) ** 2, axis=0)
        products = Products(left.columns.sum(axis=0), left.outputs.sum(axis=0)).without(length2)
        sensors = {problem.sensors[i] for j in group for i in np.flatnonzero(concerns(problem, j) > 0.01)}
        return rivals(problem.candidates, products, group, rest, sensors, problem.units, self.searched)

    def _others(self, chosen: tuple[int, ...], j: int) -> tuple[int, ...]:
        return tuple(k for k in chosen if k not in self.unit(j))

    def _p_here(self, chosen: tuple[int, ...], j: int) -> float:
        others, u = self._others(chosen, j), self.problem.unit_of[j]
        if (frozenset(others), u) in self._known:
            return self._known[frozenset(others), u]
        scores = score(self.problem, others, (u,))
        if scores.p[u] > self.family.critical:
            return float(self.family.adjust(scores.p[u]))
        return self._again(others, u, scores)

    def _again(self, chosen: tuple[int, ...], u: int, scores: Scores) -> float:
        key = frozenset(chosen), u
        if key not in self._known:
            p = second_thoughts(self.problem, chosen, u, scores, self.family.critical)
            self._known[key] = float(self.family.adjust(p))
        return self._known[key]

    @cached_property
    def _known(self) -> dict[tuple[frozenset[int], int], float]:
        return {}

    def _between(self, chosen: tuple[int, ...]) -> FloatArray:
        """(U,) p between replications, each multiplied by the number of its kind over their share of the family.

        Searched time constants are a kind of their own, or they would take the power from all others.

        What varies within replications too says something there, of which what it does between them knows nothing: the
        two are put together as Fisher does.
        """
        gamma = coefficients(self.problem, chosen, "declared")[0]
        p = p_between_replications(self.problem, chosen, gamma)
        effects = [self.candidates[unit[0]].effect for unit in self.problem.units]
        sought = np.array([e.searched and e.stratum != "replication" for e in effects], bool)
        tests = np.where(sought, max(int(np.sum(p[sought] < 1.0)), 1), max(int(np.sum(p[~sought] < 1.0)), 1))
        both = [
            u
            for u in np.flatnonzero(p < TOGETHER).tolist()
            if self.problem.judged_at[self.problem.units[u][0]] == "points"
        ]
        scores = score(self.problem, chosen, both)
        for u in both:
            product = max(p[u] * second_thoughts(self.problem, chosen, u, scores, 1.0), np.finfo(float).tiny)
            p[u] = product * (1.0 - np.log(product))
        return np.asarray(np.minimum(p * tests / COUNTED, 1.0))
