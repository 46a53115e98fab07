"""What stands out of an attitude run, over both of its tests: of single observations, and between replications."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fitter.arrays import FloatArray
from fitter.effects import Stratum
from fitter.trace.aliases import Rival, rivals
from fitter.trace.estimate import coefficients, concerns, estimate
from fitter.trace.family import ALPHA, COUNTED, Family
from fitter.trace.problem import Candidate, Problem
from fitter.trace.replications import p_between_replications
from fitter.trace.score import errors, score, whiten


@dataclass(frozen=True, eq=False)
class AttitudeJudge:
    """A `fitter.trace.search.Judge` of pitch-roll runs."""

    problem: Problem
    family: Family

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """All there are, in catalogue order."""
        return self.problem.candidates

    def best(self, chosen: tuple[int, ...]) -> int | None:
        """The candidate that removes most beside those `chosen`, of those that stand out."""
        if not self.candidates:
            return None
        scores = score(self.problem, chosen)
        found = np.flatnonzero(self.family.adjust(scores.p) <= ALPHA)
        if found.size:
            return int(found[np.argmax(scores.gain[found])])
        between = self._between(chosen)
        best = int(np.argmin(between))
        return best if between[best] <= ALPHA else None

    def p_adjusted(self, chosen: tuple[int, ...], j: int) -> float:
        """Probability that the best of the family looks as good as `j` beside the other `chosen` by chance."""
        others = tuple(k for k in chosen if k != j)
        p = float(self.family.adjust(score(self.problem, others, (j,)).p[j]))
        return p if p <= ALPHA else min(p, float(self._between(others)[j]))

    def stratum_of(self, chosen: tuple[int, ...], j: int) -> Stratum:
        """The stratum in which `j` stands out beside the other `chosen`."""
        others = tuple(k for k in chosen if k != j)
        if float(self.family.adjust(score(self.problem, others, (j,)).p[j])) > ALPHA:
            return "replication"
        return "point-by-replication" if self.problem.judged_at[j] == "points" else "between-point"

    def rivals(self, chosen: tuple[int, ...], effect: str) -> tuple[Rival, ...]:
        """All explanations of what the terms of `effect` among `chosen` explain, where coefficients are estimated."""
        problem = self.problem
        group = tuple(j for j in chosen if problem.candidates[j].effect.name == effect)
        rest = tuple(j for j in chosen if j not in group)
        white = whiten(problem, estimate(problem, chosen).level, rest, errors(problem, chosen))
        sensors = {problem.sensors[i] for j in group for i in np.flatnonzero(concerns(problem, j) > 0.01)}
        return rivals(problem.candidates, white, group, rest, sensors)

    def _between(self, chosen: tuple[int, ...]) -> FloatArray:
        """(J,) p between replications, each multiplied by the number of tests over their share of the family."""
        gamma = coefficients(self.problem, chosen, "declared")[0]
        p = p_between_replications(self.problem, chosen, gamma)
        tests = max(int(np.sum(p < 1.0)), 1)
        return np.asarray(np.minimum(p * tests / COUNTED, 1.0))
