"""Significance of candidates in a whole-plot run."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.trace.aliases import DELTA, PER_COLUMN, Products, Rival, rivals, simplest
from rig.fitter.trace.chance import ALPHA
from rig.fitter.trace.signs import SURE, Impossible
from rig.procedures.pressure.trace.null import Families, family_of
from rig.procedures.pressure.trace.problem import Candidate, Problem
from rig.procedures.pressure.trace.score import NOTHING_LEFT, Beside, Scores, beside, score
from rig.procedures.pressure.trace.strata import Level

TRIED = 3
"""Maximum number of candidates tried as one of two that mask each other: the remainder of one in whole plots increases
the other's standard error.
"""


@dataclass(frozen=True, eq=False)
class WholePlotJudge:
    """A `rig.fitter.trace.search.Judge` of whole-plot runs."""

    problem: Problem
    family: Families

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """All candidates, in catalogue order."""
        return self.problem.candidates

    def unit(self, j: int) -> tuple[int, ...]:
        """Every candidate separately."""
        return (j,)

    def refined(self, chosen: tuple[int, ...]) -> WholePlotJudge:
        """Unchanged: searched constants are those of the catalogue."""
        return self

    def best(self, chosen: tuple[int, ...]) -> tuple[int, ...]:
        """The candidate that reduces the residual most beside those `chosen`, among the significant ones; or two
        masking each other.
        """
        if not self.candidates:
            return ()
        scores = score(self.problem, chosen)
        found = np.flatnonzero((self.family.adjust(scores.p) <= ALPHA) & self._possible(scores))
        if found.size:
            return (self._clearest(found, scores),)
        hidden = np.flatnonzero((self.family.adjust(scores.p_plain) <= ALPHA) & self._possible(scores))
        for j in hidden[np.argsort(-scores.gain[hidden])][:TRIED].tolist():
            beside_it = score(self.problem, (*chosen, j))
            able = np.where(self._possible(beside_it), self.family.adjust(beside_it.p), 1.0)
            other = int(np.argmin(able))
            if able[other] <= ALPHA and self.p_adjusted((*chosen, j, other), j) <= ALPHA:
                return j, other
        return ()

    def _clearest(self, found: NDArray[np.int64], scores: Scores) -> int:
        """That of the candidates `found` which removes most in its stratum, of both strata's the clearer one.

        Of few whole plots no effect removes more than there are, however clear it is.
        """
        levels = np.array(self.problem.judged_at)[found]
        each = [found[levels == level] for level in dict.fromkeys(levels.tolist())]
        best = [int(of[np.argmax(scores.gain[of])]) for of in each]
        return max(best, key=lambda j: abs(float(scores.t[j])))

    def p_adjusted(self, chosen: tuple[int, ...], j: int) -> float:
        """Probability that the best of the family looks as good as `j` beside the other `chosen` by chance."""
        others = tuple(k for k in chosen if k != j)
        scores = score(self.problem, others, (j,))
        return 1.0 if self.wrong(scores)[j] else self.family.adjusted(float(scores.p[j]), j)

    def is_bound(self, p: float, terms: Sequence[int]) -> bool:
        """Whether no simulated run had such a score as these terms, of which p is the smallest."""
        return p <= min(map(self.family.least, terms))

    def alone(self, chosen: tuple[int, ...]) -> tuple[Impossible, ...]:
        """Candidates that are significant beside those `chosen`, except for their required sign."""
        if not np.any(self.signs):
            return ()
        scores = score(self.problem, chosen)
        value, error = scores.gamma, np.abs(scores.gamma) / np.maximum(np.abs(scores.t), np.finfo(float).tiny)
        return tuple(Impossible(j, float(value[j]), float(error[j])) for j in self.unsigned(chosen, scores))

    def unsigned(self, chosen: tuple[int, ...], scores: Scores) -> Sequence[int]:
        """Those of a wrong sign that are significant beside those `chosen`."""
        return np.flatnonzero((self.family.adjust(scores.p) <= ALPHA) & self.wrong(scores)).tolist()

    def lead(self, explanations: Sequence[Rival]) -> Rival:
        """The simplest of the indistinguishable ones; a suspected one leads only if there is no other."""
        suspected = {c.effect.name for c in self.candidates if c.effect.on_suspicion}
        return simplest([r for r in explanations if r.alias and r.effect not in suspected] or explanations)

    def rivals(self, chosen: tuple[int, ...], effect: str) -> tuple[Rival, ...]:
        """All explanations for the terms of `effect` among `chosen`, in their stratum. Terms of the effect supported by
        the other stratum are kept with every explanation.
        """
        return self._rivals(chosen, effect, np.inf)

    def alike(self, chosen: tuple[int, ...], effect: str) -> tuple[Rival, ...]:
        """The same without most that are not aliases."""
        return self._rivals(chosen, effect, DELTA)

    def rows(self, rest: Problem, kept: IntArray, chosen: Iterable[int]) -> WholePlotJudge:
        """The same for the `rest` of the run, of the rows `kept`."""
        return replace(self, problem=rest)

    def _rivals(self, chosen: tuple[int, ...], effect: str, within: float) -> tuple[Rival, ...]:
        problem, every = self.problem, np.arange(len(self.candidates))
        named = tuple(j for j in chosen if problem.candidates[j].effect.name == effect)
        level = problem.judged_at[named[0]]
        group = tuple(j for j in named if problem.judged_at[j] == level)
        rest = tuple(j for j in chosen if j not in group)
        line = any(problem.candidates[j].sensor is None for j in group)
        sensors = problem.sensors if line else {str(problem.candidates[j].sensor) for j in group}
        able_to = [j for j, c in enumerate(self.candidates) if c.sensor is None or c.sensor in sensors]
        mine = problem.within(level, able_to)
        stratum, error = beside(problem, level, rest, mine), beside(problem, level, chosen, ()).sigma
        scores = score(problem, rest, mine.tolist())
        able = (self._possible(scores) | self.wrong(scores) | np.isin(every, group))[mine]
        able &= self._left(level, stratum, mine)
        elsewhere = tuple(j for j in named if j not in group)
        searched = {e.name for c in self.candidates if (e := c.effect).searched and (len(sensors) == 1 or not c.sensor)}
        stratum.white.columns[:, :, ~able] = 0.0
        products = Products.of(stratum.white, (stratum.sigma / error) ** 2, (mine, every.size))
        products = replace(products, signs=self.signs)
        own = self._tried(Rival(effect, group, 0.0, effect in searched))
        found = rivals(problem.candidates, products, group, rest, sensors, searched=searched, within=within + own)
        price = np.array([rival.sigmas**2 + self._tried(rival) for rival in found])
        least = min(p for p, rival in zip(price.tolist(), found, strict=True) if not rival.refused)
        price = np.maximum(price, least)
        return tuple(
            replace(found[k], terms=(*found[k].terms, *elsewhere), sigmas=float(np.sqrt(price[k] - least)))
            for k in np.argsort(price, kind="stable")
        )

    def _tried(self, rival: Rival) -> float:
        """Price of a searched constant in addition to a column's price: the best of m columns gains 2 ln m by
        chance.
        """
        gained = -2.0 * float(np.log(self.family.share[rival.terms[0]]))
        return max(gained - PER_COLUMN * rival.searched, 0.0)

    def _possible(self, scores: Scores) -> NDArray[np.bool_]:
        """(J,) candidates whose coefficient has a possible size and sign, within three sd."""
        size = np.abs(scores.gamma)
        small = size - 3.0 * size / np.maximum(np.abs(scores.t), np.finfo(float).tiny) <= self._most
        return np.asarray(small & ~self.wrong(scores))

    @cached_property
    def _most(self) -> FloatArray:
        """(J,) largest plausible size of each candidate's coefficient."""
        return np.array([c.effect.at_most for c in self.candidates], np.float64)

    def wrong(self, scores: Scores) -> NDArray[np.bool_]:
        """(J,) candidates whose coefficient certainly has a physically impossible sign."""
        return np.asarray(self.signs * scores.t < -SURE)

    @cached_property
    def signs(self) -> FloatArray:
        """(J,) physical sign of each candidate's coefficient; 0 if both are possible. A line's error is one of
        pressure, independent of sensitivities; a transducer's own is relative to its output.
        """
        return np.array([c.effect.sign(c.term.name) for c in self.candidates], np.float64)

    def _left(self, level: Level, stratum: Beside, mine: NDArray[np.int64]) -> NDArray[np.bool_]:
        """(q,) those of the candidates `mine` of a level that have a sufficient remainder beside the others."""
        length = np.linalg.norm(self.problem.length_at[level][:, mine] / stratum.sigma[:, None], axis=0)
        left = np.sqrt(np.einsum("smj,smj->j", stratum.white.columns, stratum.white.columns))
        return np.asarray(left > NOTHING_LEFT * length)


Judging = Callable[[Problem, FloatArray, "WholePlotJudge | None"], WholePlotJudge]
"""Makes the judge of a run, given (n,) its pressure, and a judge of the same run with other weights, if any."""


def by_strata(seed: int) -> Judging:
    """Judges that hold each candidate against the error of its stratum; `seed` is of the simulated null."""
    return lambda run, pressure_psia, known: WholePlotJudge(run, family_of(run, seed))
