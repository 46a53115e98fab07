"""What stands out of a whole-plot run."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fitter.trace.aliases import Products, Rival, rivals
from fitter.trace.family import ALPHA, Family
from fitter.trace.whitened import Whitened
from fitter.trace.whole_plots.problem import Candidate, Problem
from fitter.trace.whole_plots.score import NOTHING_LEFT, Beside, beside, score
from fitter.trace.whole_plots.strata import Level


@dataclass(frozen=True, eq=False)
class WholePlotJudge:
    """A `fitter.trace.search.Judge` of whole-plot runs."""

    problem: Problem
    family: Family

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """All there are, in catalogue order."""
        return self.problem.candidates

    def unit(self, j: int) -> tuple[int, ...]:
        """Every candidate by itself."""
        return (j,)

    def refined(self, chosen: tuple[int, ...]) -> WholePlotJudge:
        """Itself: the constants searched are those of the catalogue."""
        return self

    def best(self, chosen: tuple[int, ...]) -> tuple[int, ...]:
        """The candidate that removes most beside those `chosen`, of those that stand out."""
        if not self.candidates:
            return ()
        scores = score(self.problem, chosen)
        found = np.flatnonzero(self.family.adjust(scores.p) <= ALPHA)
        return (int(found[np.argmax(scores.gain[found])]),) if found.size else ()

    def p_adjusted(self, chosen: tuple[int, ...], j: int) -> float:
        """Probability that the best of the family looks as good as `j` beside the other `chosen` by chance."""
        others = tuple(k for k in chosen if k != j)
        return float(self.family.adjust(score(self.problem, others, (j,)).p[j]))

    def rivals(self, chosen: tuple[int, ...], effect: str) -> tuple[Rival, ...]:
        """All explanations of what the terms of `effect` among `chosen` explain, in the stratum they are judged in.

        Terms of the effect that the other stratum bears out stay with every explanation.
        """
        problem = self.problem
        named = tuple(j for j in chosen if problem.candidates[j].effect.name == effect)
        level = problem.judged_at[named[0]]
        group = tuple(j for j in named if problem.judged_at[j] == level)
        rest = tuple(j for j in chosen if j not in group)
        stratum, error = beside(problem, level, rest), beside(problem, level, chosen, ()).sigma
        scale = (stratum.sigma / error)[:, None]
        columns = np.where(self._judged(level, stratum), stratum.white.columns * scale[:, :, None], 0.0)
        white = Whitened(stratum.white.outputs * scale, columns)
        line = any(problem.candidates[j].sensor is None for j in group)
        sensors = problem.sensors if line else {str(problem.candidates[j].sensor) for j in group}
        elsewhere = tuple(j for j in named if j not in group)
        found = rivals(problem.candidates, Products.of(white), group, rest, sensors)
        return tuple(replace(rival, terms=(*rival.terms, *elsewhere)) for rival in found)

    def _judged(self, level: Level, stratum: Beside) -> NDArray[np.bool_]:
        """(J,) candidates of a level that enough is left of beside the others to explain something there."""
        length = np.linalg.norm(self.problem.length_at[level] / stratum.sigma[:, None], axis=0)
        left = np.linalg.norm(stratum.white.columns, axis=(0, 1)) > NOTHING_LEFT * length
        return np.asarray(left & np.isin(np.arange(len(self.candidates)), self.problem.within(level)))
