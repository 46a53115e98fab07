"""Significance of candidates in a table, each tested with its own estimate of noise."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial

import numpy as np

from rig.fitter import ties
from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.trace.aliases import DELTA, Rival
from rig.fitter.trace.chance import ALPHA
from rig.fitter.trace.engine.family import CERTAIN, TableFamily, evidence, family_of, least_of
from rig.fitter.trace.engine.lengths import Simulated
from rig.fitter.trace.engine.likelihood import Grid, Likelihoods, ratio
from rig.fitter.trace.engine.models import Key, Models
from rig.fitter.trace.engine.noise import BoolArray
from rig.fitter.trace.engine.problem import Candidate, Problem
from rig.fitter.trace.engine.rivalry import Rivalry, Trial, possible, possible_of
from rig.fitter.trace.engine.rivals import lead, rivals
from rig.fitter.trace.engine.robust import isolated
from rig.fitter.trace.engine.score import Scores, View, ranked, score

SHORTLIST = 8
"""Number of effects examined closely at each step, by their reduction of the residual."""
MANY = 1000
"""Rows from which on a score that is certain, or plainly nothing, is not held against simulated ones: they take seconds
then, and F has its distribution.
"""
PLAINLY = 2.0
"""Ratio to a level above which an effect's own p is above it in whatever family, which is not simulated then."""
CLOSE = 3.0 * ALPHA
"""Largest p for which the slowest plausible noise is tested too."""
DOUBTFUL = 5.0
"""Weight of p of a drift over an undeclared order; others have weight one (weighted family-wise error: Genovese, Roeder
and Wasserman, Biometrika 93 (2006) 509).
"""
PAIRED = 3
"""Number of effects in time that are tried in pairs if none is significant by itself. Each of two has to be significant
beside the other, one of them by this factor more, because of the number of trials.
"""
AKAIKE = 2.0
"""Twice the log-likelihood that a column has to gain to be likelier in than out."""
WALKS: tuple[Rivalry, ...] = ("fast", "slow")
"""Rivals of an effect that is ahead of every slow walk: noise of short memory, and such walks."""


@dataclass(frozen=True, eq=False)
class TableJudge:
    """A `rig.fitter.trace.search.Judge` of blocks of columns.

    Attributes:
        problem: the table.
        families: simulated so far, by covariance and rival; used for parts of the table too.
    """

    problem: Problem
    families: dict[tuple[int, Rivalry], TableFamily] = field(default_factory=dict)
    _views: dict[int, View] = field(default_factory=dict)
    _held: dict[Key, FloatArray] = field(default_factory=dict)
    _off: dict[Key, FloatArray] = field(default_factory=dict)
    _besides: dict[Key, Likelihoods] = field(default_factory=dict)
    _trials: dict[tuple[Key, int], Trial] = field(default_factory=dict)
    _evidence: dict[tuple[Key, int, Rivalry], float] = field(default_factory=dict)
    _p: dict[tuple[Key, int], float] = field(default_factory=dict)

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """All candidates, cheapest first."""
        return self.problem.candidates

    def unit(self, j: int) -> tuple[int, ...]:
        """Every candidate separately."""
        return (j,)

    def refined(self, chosen: tuple[int, ...]) -> TableJudge:
        """Unchanged: searched constants are refined after the search."""
        return self

    def best(self, chosen: tuple[int, ...]) -> tuple[int, ...]:
        """The most evident candidate beside those `chosen`, among the significant ones."""
        ranked = [j for j in self.promising(chosen) if not self.problem.crowded(chosen, j)]
        single = next(((j,) for j in ranked if self._within(chosen, j, ALPHA)), ())
        return single or self._pair(chosen, ranked)

    def judged(self, chosen: tuple[int, ...]) -> BoolArray | None:
        """(J,) candidates that are judged beside those `chosen`; None for all."""
        return None

    def worth(self, chosen: tuple[int, ...], unit: Sequence[int]) -> float:
        """Twice the log-likelihood ratio of some candidates beside those `chosen`, less the price of their columns."""
        gained = float(self.beside((*chosen, *unit)).ml.max() - self.beside(chosen).ml.max())
        return 2.0 * gained - float(np.log(self.problem.n)) * float(sum(self.problem.price[j] for j in unit))

    def _pair(self, chosen: tuple[int, ...], ranked: Sequence[int]) -> tuple[int, ...]:
        """Two effects in time that are significant only beside each other; either alone looks like a random walk."""
        if not self.problem.noise.slow[self.beside(chosen).best]:
            return ()
        for j in [j for j in ranked if self.candidates[j].effect.source == "time"][:PAIRED]:
            for k in self.promising((*chosen, j), "time"):
                if self.candidates[k].effect.name == self.candidates[j].effect.name:
                    continue
                both = (((*chosen, j), k), ((*chosen, k), j))
                if all(self._within(*one, ALPHA) for one in both) and any(
                    self._within(*one, ALPHA / PAIRED) for one in both
                ):
                    return (j, k)
        return ()

    def p_adjusted(self, chosen: tuple[int, ...], j: int) -> float:
        """Probability that the best of the family looks as good as `j` beside the other `chosen` by chance."""
        return self.p_up_to(chosen, j, np.inf)

    def p_up_to(self, chosen: tuple[int, ...], j: int, most: float) -> float:
        """The same; it need only be known to be above `most`, or in a large table not to be."""
        whole, rest = tuple(sorted(chosen)), tuple(k for k in chosen if k != j)
        if (whole, j) not in self._p:
            self._grid(whole)  # from which each of them is taken out
            p = 1.0 if self.refused(rest, j) else self.adjusted(rest, j, most)
            if p > most or (self._many and most < np.inf):
                return p
            self._p[whole, j] = p
        return self._p[whole, j]

    def significant(self, chosen: tuple[int, ...], j: int) -> bool:
        """Whether `j` counts as found beside the other `chosen`."""
        rest = tuple(k for k in chosen if k != j)
        return not self.refused(rest, j) and self._within(rest, j, ALPHA)

    def _within(self, chosen: tuple[int, ...], j: int, level: float) -> bool:
        return self.adjusted(chosen, j, level) <= level

    def refused(self, chosen: tuple[int, ...], j: int) -> bool:
        """Whether the coefficient of `j` beside those `chosen` has an impossible sign or size."""
        if not self.candidates[j].sign and not np.isfinite(self.candidates[j].most):
            return False
        at = self.beside((*chosen, j)).best
        return not self._possible(at, chosen, self._scores(at, chosen))[j]

    def suspects(self, chosen: tuple[int, ...], most: float) -> tuple[tuple[str, float], ...]:
        """The effects nearest to significance beside those `chosen`, with their p up to `most`, nearest first."""
        best: dict[str, float] = {}
        for j in self.promising(chosen):
            if self.adjusted(chosen, j, most) <= most:  # most are above it, which takes a part of the simulation
                name = self.candidates[j].effect.name
                best[name] = min(self.adjusted(chosen, j), best.get(name, 1.0))
        return tuple(ties.ordered(best.items(), key=lambda item: item[1]))

    def beats_wander(self, chosen: tuple[int, ...], effect: str) -> float | None:
        """Twice the log-likelihood ratio of an effect to a slow random walk in its place, with the price of columns.

        None if no slow walk is possible.
        """
        slow = self.problem.noise.slow
        if not np.any(slow) or np.all(slow):
            return None
        mine = [j for j in chosen if self.candidates[j].effect.name == effect]
        rest = tuple(j for j in chosen if j not in mine)
        price, whole = float(np.log(self.problem.n)) * sum(map(float, self.problem.price[mine])), tuple(sorted(chosen))
        self._grid(whole)
        without = self._models.without(whole, mine, self.held(rest)) or self.beside(rest)
        return float(2.0 * (self.beside(chosen).ml.max() - without.ml[slow].max()) - price)

    def like_memory(self, chosen: tuple[int, ...], still: BoolArray) -> tuple[str, ...]:
        """Effects that explain about as much as errors with memory, likeliest first, and what may be a part of these.

        Each of them is significant beside the likeliest covariance without memory, one of those of `still` (G,). A
        part is a plain course in time with which errors with memory are likelier than alone (Akaike).
        """
        found = dict[str, float]()
        for j in self.promising(chosen):
            trial, effect, term = self._trial(chosen, j), self.candidates[j].effect, self.candidates[j].term
            at, name = trial.beside.best_of(still), effect.name
            behind = 2.0 * float(trial.without.ml.max() - trial.beside.ml[at])
            gained = 2.0 * float(trial.beside.ml.max() - trial.without.ml.max())
            part = effect.source == "time" and term.profile is None and gained > AKAIKE * term.price
            if behind <= DELTA or part:
                own = float(self._scored(at, trial.y, chosen, j).evidence[0])
                if self.family_for(j, at, "any").adjust(name, own, ALPHA) <= ALPHA:
                    found[name] = min(behind, found.get(name, behind))
        return tuple(ties.ordered(found, key=found.__getitem__, unit=1.0))

    def is_bound(self, p: float) -> bool:
        """Whether no simulated table had such a score."""
        return p == self._least or any(p == family.least for family in self.families.values())

    def rivals(self, chosen: tuple[int, ...], effect: str) -> tuple[Rival, ...]:
        """All explanations for the terms of `effect` among `chosen`, best first."""
        at = self.beside(chosen).best
        return rivals(self.problem, self.view(at), self.white(at, chosen), chosen, effect)

    def alike(self, chosen: tuple[int, ...], effect: str) -> tuple[Rival, ...]:
        """The same: a table has few candidates."""
        return self.rivals(chosen, effect)

    def lead(self, found: Sequence[Rival]) -> Rival:
        """The most probable of the indistinguishable explanations."""
        return lead(self.problem, found)

    def beside(self, chosen: tuple[int, ...], extra: FloatArray | None = None) -> Likelihoods:
        """Likelihoods of common noise of rows, with the declared columns, those `chosen`, and `extra` ones (n, d)."""
        key = tuple(sorted(chosen))
        if extra is not None:
            return self._grid(key).beside(extra)
        if key not in self._besides:
            self._besides[key] = self._grid(key).beside()
        return self._besides[key]

    def each(self, terms: Sequence[int]) -> FloatArray:
        """(G, q) restricted log-likelihoods beside the declared columns and each of some candidates of one column."""
        return self._grid(()).each(self.problem.of(terms) / self.problem.sd[:, None])

    @cached_property
    def _models(self) -> Models:
        return Models(self.problem)

    def _grid(self, key: Key) -> Grid:
        """The model of some candidates, with the response that is held beside them."""
        if key:
            self._grid(())  # of which it is made
        return self._models.grid(key, self.held(key))

    @cached_property
    def _simulated(self) -> Simulated:
        return Simulated(self.problem)

    def view(self, at: int) -> View:
        """The problem whitened by covariance `at`."""
        if at not in self._views:
            self._views[at] = View.of(self.problem, at)
        return self._views[at]

    def taken(self, at: int, chosen: tuple[int, ...]) -> FloatArray:
        """(n, q) orthonormal basis of the declared columns and some candidates, whitened by covariance `at`."""
        view, some = self._of_some(at, chosen)
        return view.taken(some)

    def _of_some(self, at: int, terms: Key) -> tuple[View, Key]:
        """The problem whitened by covariance `at`, with some candidates at least, and their numbers in it."""
        known = self._views.get(at)
        return (known, terms) if known else (View.of(self.problem.only(terms), at), tuple(range(len(terms))))

    def held(self, chosen: tuple[int, ...]) -> FloatArray:
        """(n,) the response with isolated outliers beside those `chosen` reduced."""
        key = tuple(sorted(chosen))
        if key not in self._held:
            self._held[key] = self.problem.y - self._alone(key)
        return self._held[key]

    def _alone(self, key: Key) -> FloatArray:
        """(n,) reduction of isolated outliers beside those of a `key`."""
        if key not in self._off:
            (view, some), own = self._of_some(0, key), self.problem
            off = isolated(view.y, view.taken(some), own.ordered, own.step, lambda: own.near, own.group, own.sd)
            self._off[key] = off * own.sd
        return self._off[key]

    def white(self, at: int, chosen: tuple[int, ...]) -> FloatArray:
        """(n,) `held`, whitened by covariance `at`."""
        return self._white(at, self.held(chosen))

    def _white(self, at: int, y: FloatArray) -> FloatArray:
        return np.asarray(self.problem.noise.whiten(np.array([at]), (y / self.problem.sd)[:, None])[0, :, 0])

    def family(self, at: int, rival: Rivalry = "any") -> TableFamily:
        """Distribution of the best score by chance under covariance `at`, relative to a `rival`."""
        if (at, rival) not in self.families:
            without, beside = possible_of(self.problem, rival)
            self.families[at, rival] = family_of(
                self.problem,
                at,
                self._weight,
                seed=1 + at,
                without=without,
                beside=beside,
                scatter=None if rival == "slow" else partial(_some_of, self.problem, at),
                simulated=self._simulated,
                sooner=self._many,
            )
        return self.families[at, rival]

    def family_for(self, j: int, at: int, rival: Rivalry) -> TableFamily:
        """The family in which candidate `j` is judged."""
        return self.family(at, rival)

    def adjusted(self, chosen: tuple[int, ...], j: int, most: float = np.inf) -> float:
        """Family-wise p of `j` beside those `chosen`; whether it is above `most` is all that need be known.

        It has to be significant against the best-fitting noise without it. Or it has to be better than every slow walk,
        with noise of short memory beside it, and significant both against noise of short memory and against slow walks
        that are noise (a test of hypotheses of which neither contains the other: Cox, Proc. 4th Berkeley Symp. 1 (1961)
        105, its distribution simulated).
        """
        trial = self._trial(chosen, j)
        ahead = trial.ahead > np.log(self.problem.n) * self.candidates[j].term.price
        if ahead and all(self._against(trial, chosen, j, rival, ALPHA) <= ALPHA for rival in WALKS):
            return max(self._against(trial, chosen, j, rival, most) for rival in WALKS)
        return self._against(trial, chosen, j, "any", most)

    def _against(self, trial: Trial, chosen: tuple[int, ...], j: int, rival: Rivalry, most: float) -> float:
        """Family-wise p of `j` against one rival; 0 if the noise of the table has no such rival.

        The larger of two: with the noise that is most probable without it, and with the slowest that is plausible. The
        correlation of neighbours is underestimated in short tables (Berger and Boos, JASA 89 (1994) 1012).
        """
        possible = possible_of(self.problem, rival)
        if not np.any(possible[0]):
            return 0.0
        if (own := self._evident(trial, chosen, j, rival)) == -np.inf:
            return 1.0
        if self._many and own > CERTAIN:
            return self._least or self.family_for(j, trial.without.best_of(possible[0]), rival).least
        if self._many and math.exp(-own) > PLAINLY * most:
            return math.exp(-own)
        name = self.candidates[j].effect.name
        p = self.family_for(j, trial.without.best_of(possible[0]), rival).adjust(name, own, most)
        if p > min(most, CLOSE) or rival == "slow":
            return p
        return max(p, self.family_for(j, trial.without.slowest_of(possible[0]), rival).adjust(name, own, most))

    def _evident(self, trial: Trial, chosen: tuple[int, ...], j: int, rival: Rivalry) -> float:
        """Score of `j` against one rival, -log p; minus infinity if it explains nothing."""
        key = tuple(sorted(chosen)), j, rival
        if key not in self._evidence:
            possible = possible_of(self.problem, rival)
            scores = self._scored(trial.beside.best_of(possible[1]), trial.y, chosen, j)
            rank, df, own = int(scores.rank[0]), int(scores.df[0]), -np.inf
            if scores.ratio[0] > 0.0:
                scatter = 1.0 if rival == "slow" else float(scores.scatter[0])
                own = float(
                    evidence(np.array(ratio(trial.without, trial.beside, possible, rank, df) / scatter), rank, df)
                )
            self._evidence[key] = own
        return self._evidence[key]

    def _scored(self, at: int, y: FloatArray, chosen: tuple[int, ...], j: int) -> Scores:
        """`j` beside those `chosen` under a covariance, with a response (n,)."""
        view, (*rest, last) = self._of_some(at, (*chosen, j))
        return score(view, self._white(at, y), rest, (last,))[0]

    def promising(self, chosen: tuple[int, ...], source: str | None = None) -> Iterable[int]:
        """The best term of each promising effect, by evidence minus the price of its columns; with a `source`, those
        of it alone.
        """
        if not self.candidates:
            return ()
        beside = self.beside(chosen)
        per_column = float(np.log(self.problem.n))
        shortlist: dict[int, float] = {}
        for at in dict.fromkeys((0, beside.best)):
            scores = self._scores(at, chosen)
            worth = scores.evidence - per_column * self.problem.price
            if self.problem.bounded:
                worth = np.where(self._possible(at, chosen, scores), worth, -np.inf)
            if (judged := self.judged(chosen)) is not None:
                worth = np.where(judged, worth, -np.inf)
            best: dict[str, int] = {}
            for j in ties.descending(worth).tolist():
                if scores.ratio[j] > 0 and len(best) < SHORTLIST:
                    best.setdefault(self.candidates[j].effect.name, j)
            shortlist.update({j: float(worth[j]) for j in best.values() if worth[j] > -per_column})
        if source is not None:
            shortlist = {j: own for j, own in shortlist.items() if self.candidates[j].effect.source == source}
        for j in shortlist:
            shortlist[j] = self._trial(chosen, j).gained - per_column * float(self.problem.price[j])
        return [list(shortlist)[k] for k in ties.descending(list(shortlist.values()))]

    def _scores(self, at: int, chosen: tuple[int, ...]) -> Scores:
        """All candidates beside those `chosen` under a covariance."""
        return ranked(self.view(at), self.white(at, chosen), chosen)

    def _possible(self, at: int, chosen: tuple[int, ...], scores: Scores) -> BoolArray:
        """(J,) candidates whose coefficient has a possible sign and size, within three standard errors."""
        return possible(self.problem, self.view(at), self.white(at, chosen), chosen, scores)

    @property
    def _many(self) -> bool:
        """Whether there are so many rows that F has its distribution."""
        return self.problem.n >= MANY

    @cached_property
    def _least(self) -> float | None:
        """The least p of every family, if it is known without one."""
        return least_of(self.problem) if self._many else None

    @cached_property
    def _weight(self) -> FloatArray:
        """(J,) factor of p before effects are compared."""
        doubtful = [self.problem.presumed and c.effect.source == "time" for c in self.candidates]
        return np.where(doubtful, DOUBTFUL, 1.0)

    def _trial(self, chosen: tuple[int, ...], j: int) -> Trial:
        """`j` beside those `chosen`; a reading is reduced only as far as it is isolated without and with `j`."""
        key, whole = tuple(sorted(chosen)), tuple(sorted((*chosen, j)))
        if (key, j) not in self._trials:
            held, off = self.held(key), self._alone(key)
            if np.any(off):
                with_j = self._alone(whole)
                milder = np.where(off * with_j > 0, np.minimum(np.abs(off), np.abs(with_j)), 0.0) * np.sign(off)
                held = held if np.array_equal(milder, off) else self.problem.y - milder
            self._grid(())
            self._trials[key, j] = Trial(held, *self._models.with_one(key, j, held, self.held(key)))
        return self._trials[key, j]


def _some_of(problem: Problem, at: int, terms: IntArray) -> View:
    """Some candidates whitened anew: families outlive a judge, and its views are large."""
    return View.of(problem.only(terms.tolist()), at)
