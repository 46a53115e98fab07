"""What stands out of a table: candidates judged beside one another, each with the noise that is left beside it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from fitter.arrays import FloatArray
from fitter.trace.aliases import PER_COLUMN, Rival
from fitter.trace.family import ALPHA, Family
from fitter.trace.tables.family import family_of
from fitter.trace.tables.likelihood import Beside, Grid
from fitter.trace.tables.noise import BoolArray
from fitter.trace.tables.problem import Candidate, Problem
from fitter.trace.tables.rivals import rivals
from fitter.trace.tables.robust import excess
from fitter.trace.tables.score import View, score

SHORTLIST = 8
"""Effects that are looked at more closely at each step, by what they remove."""

SMALL_PART = 5.0
"""Handicap of a term with a constant that is searched, so that knots, waves and steps, of which there are many, do not
hide the simple effects, of which there are few; and of a drift over an order that nobody vouches for (weighted
family-wise error: Genovese, Roeder and Wasserman, Biometrika 93 (2006) 509)."""
RETRIED = 1.2
"""Times that p counts, because the search is begun again with other weights, constants and readings held back."""
ALIKE = 4.0
"""Difference of twice the log-likelihood up to which the order of the catalogue decides."""
MOST_TERMS = 3
"""Of one effect with a constant that is searched: more knots or waves are not a description."""

Key = tuple[int, ...]


@dataclass(frozen=True, eq=False)
class TableJudge:
    """A `fitter.trace.search.Judge` of tables.

    Attributes:
        problem: the table.
        families: simulated so far, by covariance; shared with the judges of parts of the table.

    """

    problem: Problem
    families: dict[int, Family] = field(default_factory=dict)
    _views: dict[int, View] = field(default_factory=dict)
    _held: dict[Key, FloatArray] = field(default_factory=dict)
    _grids: dict[Key, Grid] = field(default_factory=dict)
    _besides: dict[Key, Beside] = field(default_factory=dict)
    _with: dict[tuple[Key, int], Beside] = field(default_factory=dict)

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """All there are, cheapest first."""
        return self.problem.candidates

    def unit(self, j: int) -> tuple[int, ...]:
        """Every candidate by itself."""
        return (j,)

    def refined(self, chosen: tuple[int, ...]) -> TableJudge:
        """Itself: searched constants are placed more closely once the search is through."""
        return self

    def best(self, chosen: tuple[int, ...]) -> tuple[int, ...]:
        """The candidate with most evidence beside those `chosen`, of those that stand out."""
        ranked = [j for j in self._ranked(chosen) if not self._crowded(chosen, j)]
        return next(((j,) for j in ranked if self._adjusted(chosen, j) <= ALPHA), ())

    def _crowded(self, chosen: tuple[int, ...], j: int) -> bool:
        """Whether an effect has as many terms as can be believed, or one next to `j` on the grid of its constant."""
        own, profile = self.candidates[j], self.candidates[j].term.profile
        same = [self.candidates[k] for k in chosen if self.candidates[k].effect.name == own.effect.name]
        if profile is None or not same:
            return False
        near = any(k.term.profile and profile.low <= k.term.profile.value <= profile.high for k in same)
        return near or len(same) >= MOST_TERMS

    def p_adjusted(self, chosen: tuple[int, ...], j: int) -> float:
        """Probability that the best of the family looks as good as `j` beside the other `chosen` by chance."""
        return self._adjusted(tuple(k for k in chosen if k != j), j)

    def suspects(self, chosen: tuple[int, ...]) -> tuple[tuple[str, float], ...]:
        """Effects that come nearest to standing out beside those `chosen`, with their p, nearest first."""
        tried = [(self.candidates[j].effect.name, self._adjusted(chosen, j)) for j in self._ranked(chosen)]
        best: dict[str, float] = {}
        for name, p in tried:
            best[name] = min(p, best.get(name, 1.0))
        return tuple(sorted(best.items(), key=lambda item: item[1]))

    def beats_wander(self, chosen: tuple[int, ...], effect: str) -> float | None:
        """Twice the log-likelihood by which an effect found is ahead of a slow wander in its place, columns paid for.

        None where no slow wander is possible.
        """
        slow = self.problem.noise.slow
        if not np.any(slow) or np.all(slow):
            return None
        mine = [j for j in chosen if self.candidates[j].effect.name == effect]
        rest = tuple(j for j in chosen if j not in mine)
        price = float(np.log(self.problem.n)) * sum(self.candidates[j].term.price for j in mine)
        return float(2.0 * (self.beside(chosen).ml.max() - self.beside(rest).ml[slow].max()) - price)

    def is_bound(self, p: float) -> bool:
        """Whether none of the simulated tables had the like."""
        return any(p == family.least for family in self.families.values())

    def rivals(self, chosen: tuple[int, ...], effect: str) -> tuple[Rival, ...]:
        """All explanations of what the terms of `effect` among `chosen` explain, best first."""
        at = self.beside(chosen).best
        return rivals(self.candidates, self.view(at), self.white(at, chosen), chosen, effect)

    def lead(self, found: Sequence[Rival]) -> Rival:
        """Of the explanations the data cannot tell apart the most probable, columns paid for by Schwarz' criterion.

        Of those about as probable the first in the catalogue.
        """
        extra = np.log(self.problem.n) - PER_COLUMN
        cost = {r: r.sigmas**2 + extra * sum(self.candidates[j].term.price for j in r.terms) for r in found if r.alias}
        least = min(cost.values())
        return min((r for r in cost if cost[r] - least < ALIKE), key=lambda r: min(r.terms))

    def beside(self, chosen: tuple[int, ...]) -> Beside:
        """How much noise rows share beside the declared columns and those `chosen`."""
        key = tuple(sorted(chosen))
        if key not in self._besides:
            self._besides[key] = self._grid(key).beside()
        return self._besides[key]

    def view(self, at: int) -> View:
        """The problem whitened by covariance `at`."""
        if at not in self._views:
            self._views[at] = View.of(self.problem, at)
        return self._views[at]

    def held(self, chosen: tuple[int, ...]) -> FloatArray:
        """(n,) the response, readings that stand alone beside those `chosen` brought back."""
        key = tuple(sorted(chosen))
        if key not in self._held:
            view = self.view(0)
            taken = view.taken(key)
            off = excess(view.y - taken @ (taken.T @ view.y), ordered=self.problem.ordered)
            self._held[key] = self.problem.y - off * self.problem.sd
        return self._held[key]

    def white(self, at: int, chosen: tuple[int, ...]) -> FloatArray:
        """(n,) `held`, whitened by covariance `at`."""
        column = (self.held(chosen) / self.problem.sd)[:, None]
        return np.asarray(self.problem.noise.whiten(np.array([at]), column)[0, :, 0])

    def family(self, at: int) -> Family:
        """What the best of all scores by chance under covariance `at`."""
        if at not in self.families:
            self.families[at] = family_of(self.view(at), self._handicap, seed=1 + at)
        return self.families[at]

    def _adjusted(self, chosen: tuple[int, ...], j: int) -> float:
        beside = self._beside_with(chosen, j)
        possible = self._possible(chosen, j)
        at = beside.best_of(possible)
        scores, found = score(self.view(at), self.white(at, chosen), chosen, (j,))
        p = float(scores.p(beside.inflation(at, found.units), beside.posterior(possible))[0])
        return float(self.family(at).adjust(float(self._handicap[j]) * RETRIED * p))

    def _possible(self, chosen: tuple[int, ...], j: int) -> BoolArray:
        """(G,) covariances that `j` has to stand up to: slow wanders are out if it beats them.

        It does if with errors that forget soon it is more probable, its columns paid for by Schwarz' criterion, than
        the best slow wander without it. Otherwise part of every drift and step would be put down to a wander.
        """
        slow = self.problem.noise.slow
        if not np.any(slow) or np.all(slow):
            return np.ones(len(slow), np.bool_)
        gained = self._beside_with(chosen, j).ml[~slow].max() - self.beside(chosen).ml[slow].max()
        beaten = 2.0 * gained > np.log(self.problem.n) * self.candidates[j].term.price
        return np.asarray(~slow if beaten else np.ones(len(slow), np.bool_))

    def _ranked(self, chosen: tuple[int, ...]) -> Iterable[int]:
        """The best term of each effect that promises anything, most evidence less the price of its columns first."""
        if not self.candidates:
            return ()
        beside = self.beside(chosen)
        per_column = float(np.log(self.problem.n))
        shortlist: dict[int, float] = {}
        for at in dict.fromkeys((0, beside.best)):
            scores, _ = score(self.view(at), self.white(at, chosen), chosen)
            worth = scores.evidence - per_column * self._price
            best: dict[str, int] = {}
            for j in np.argsort(-worth, kind="stable").tolist():
                if scores.ratio[j] > 0 and len(best) < SHORTLIST:
                    best.setdefault(self.candidates[j].effect.name, j)
            shortlist.update({j: float(worth[j]) for j in best.values() if worth[j] > -per_column})
        if len(beside.ml) > 1:
            for j in shortlist:
                gained = self._beside_with(chosen, j).ml.max() - beside.ml.max()
                shortlist[j] = 2.0 * float(gained) - per_column * float(self._price[j])
        return sorted(shortlist, key=lambda j: -shortlist[j])

    @property
    def _handicap(self) -> FloatArray:
        """(J,) what p is multiplied by: what is searched among many, or doubtful, takes a small part of the family."""
        doubtful = self.problem.presumed
        small = [c.term.profile is not None or (doubtful and c.effect.source == "time") for c in self.candidates]
        return np.where(small, SMALL_PART, 1.0) if small else np.empty(0)

    @property
    def _price(self) -> FloatArray:
        return np.array([c.term.price for c in self.candidates], np.float64)

    def _grid(self, key: Key) -> Grid:
        if key not in self._grids:
            problem, sd = self.problem, self.problem.sd
            self._grids[key] = Grid.of(problem.noise, self.held(key) / sd, problem.model(key) / sd[:, None])
        return self._grids[key]

    def _beside_with(self, chosen: tuple[int, ...], j: int) -> Beside:
        """Noise beside those `chosen` and `j`, readings held back as beside those `chosen` alone."""
        key = tuple(sorted(chosen))
        if (key, j) not in self._with:
            columns = self.problem.of((j,)) / self.problem.sd[:, None]
            self._with[key, j] = self._grid(key).beside(columns)
        return self._with[key, j]
