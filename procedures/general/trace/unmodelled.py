"""Shapes without a name in a table, and a comparison of each name found with them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations

import numpy as np

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.resolution import least_sd, resolution
from rig.fitter.trace.aliases import DELTA
from rig.fitter.trace.doubts import (
    BUNDLE,
    CHANGES,
    DOUBT,
    PERIODS,
    bundle,
    few_periods,
    no_better,
    several_values,
    something_left,
)
from rig.fitter.trace.engine.both import Both
from rig.fitter.trace.engine.judge import TableJudge
from rig.fitter.trace.engine.likelihood import Grid
from rig.fitter.trace.engine.noise import Noise, Wandering
from rig.fitter.trace.fine_periods import fine_period
from rig.fitter.trace.flexible import Block, Remainder, evidence, evidence_of, remainders, tried, turns
from rig.fitter.trace.limits import limit
from rig.fitter.trace.lines import Line, folded, line
from rig.fitter.trace.repeats import HARMONICS, ORDERS, repeats
from rig.fitter.trace.search import names_of
from rig.fitter.trace.two_levels import TwoLevels, two_levels
from rig.procedures.general.effects.scene import at_levels
from rig.procedures.general.trace.places import Place, places_of
from rig.procedures.general.trace.run import TableData, times_of
from rig.procedures.general.trace.together import together

ASKED_AGAIN = limit("asked again", "general")
"""Probability above which a shape is not tested against slower noise too."""
ALIKE = 2.0
"""Correlation of neighbours in standard errors, from which on two levels are searched."""
EARNED = limit("lead of a name", "general")
PLAIN = limit("lead of a plain name", "general")
"""Minimum lead in nats of a name without a searched constant: a smooth curve begins with a line or a square."""
RARE = ("fourth-order", "fifth-order", "logarithm", "reciprocal", "square-root", "ageing", "drift-second-order")
"""Kinds that need the same lead as kinds with a searched constant, because many functions are similar to them."""
NEAR = 0.05
"""Share by which a frequency may differ from twice or three times another one, as its harmonic."""
COARSE = 0.5
"""Error of rounding over that of a row from which fine periods over settings are those of the rounding."""
JUMPS = 7.0
"""Minimum lead in nats of two levels over every noise with memory."""


@dataclass(frozen=True, eq=False)
class ResidualShape:
    """A shape that a residual still follows.

    Attributes:
        place: its place.
        remainder: its part of the residual.
        p: over all places and orders.
        detail: more about it, in words behind its place.

    """

    place: Place
    remainder: Remainder
    p: float
    detail: str = ""


@dataclass(frozen=True, eq=False)
class UnmodelledSmooth:
    """A table with its findings.

    Attributes:
        judge: the judge at the end of the search.
        chosen: candidates in the model.
        data: the table.

    """

    judge: TableJudge
    chosen: tuple[int, ...]
    data: TableData

    @cached_property
    def places(self) -> tuple[Place, ...]:
        """All places for a remainder."""
        return (*places_of(self.data.scene, self.data.shared), *self._harmonics())

    def _harmonics(self) -> Iterator[Place]:
        """Twice and three times the frequency of each wave found: a periodic function need not be a sine."""
        for j in self.chosen:
            effect, term = self.judge.candidates[j].effect, self.judge.candidates[j].term
            if effect.family == "periodic" and term.profile is not None:
                for k, name in ((2.0, "half"), (3.0, "a third of")):
                    own = term.profile.at(k * term.profile.value).columns
                    block = Block(f"over {effect.columns[0]} at {name} the period found", own, (2,), np.full(2, k))
                    yield Place(block, frozenset(effect.columns))

    @cached_property
    def able(self) -> bool:
        """Whether the residual is more than rounding."""
        view = self.judge.view(0)
        left = self.left_under(0)
        return float(left @ left) > view.rounding

    @cached_property
    def left(self) -> tuple[ResidualShape, ...]:
        """Places that the residual follows, the most significant first."""
        judge = self.judge
        if not self.able:
            return ()
        beside = judge.beside(self.chosen)
        at, slow = beside.best, beside.slowest_of(np.ones(len(beside.reml), np.bool_))
        count = self._tests(self.places)
        found = []
        for place in self.places:
            for one in self._remainders(place.block, at):
                p = one.p
                if p * count < ASKED_AGAIN and slow != at:
                    again = self._remainders(place.block, slow)
                    p = max([p, *(other.p for other in again)])
                found.append(ResidualShape(place, one, min(p * count, 1.0)))
        return tuple(sorted((*found, *self._together()), key=lambda one: (one.p, -one.remainder.share)))

    def _together(self) -> Iterator[ResidualShape]:
        """A shape of all recorded quantities jointly, if the residual follows one."""
        one = together(self.judge, self.chosen, self.data)
        if one is not None:
            place, n = one.place.block.place, self.judge.problem.n
            yield ResidualShape(
                one.place,
                Remainder(place, one.p, 0.0, 0, one.share, np.zeros(n), np.empty((n, 0))),
                one.p,
                one.detail,
            )

    def p_of(self, block: Block, at: int) -> float | None:
        """P by chance of a block beside the model, under covariance `at`; None if nothing is left of it."""
        return next((one.p for one in self._remainders(block, at)), None)

    def _remainders(self, block: Block, at: int) -> list[Remainder]:
        problem = self.judge.problem
        taken = self.judge.view(at).taken(self.chosen)
        df = problem.n - taken.shape[1]

        def project(columns: FloatArray) -> FloatArray:
            white = self.white(columns, at)
            return np.asarray(white - taken @ (taken.T @ white))

        return remainders(self.left_under(at), df, [block], project) if df > 2 else []

    def left_under(self, at: int) -> FloatArray:
        """(n,) residual, whitened by covariance `at`."""
        white, taken = self.judge.white(at, self.chosen), self.judge.view(at).taken(self.chosen)
        return np.asarray(white - taken @ (taken.T @ white))

    def leave(self, columns: FloatArray, at: int) -> FloatArray:
        """(n, m) what the model leaves of columns, whitened by covariance `at`."""
        white, taken = self.white(columns, at), self.judge.view(at).taken(self.chosen)
        return np.asarray(white - taken @ (taken.T @ white))

    def white(self, columns: FloatArray, at: int) -> FloatArray:
        """(n, m) columns whitened by covariance `at`."""
        problem = self.judge.problem
        return np.asarray(problem.noise.whiten(np.array([at]), columns / problem.sd[:, None])[0])

    @cached_property
    def line(self) -> Line | None:
        """The most significant period of the residual in order or in time, alone or times a setting."""
        scene, group = self.data.scene, self.data.shared
        if scene.time is None or scene.time.presumed or not self.able:
            return None
        left = self.left_under(0)
        stretch = np.zeros(left.size, np.int64) if group is None else group
        unit = scene.time.unit_s or 1.0
        series = [left] + [left * v / np.sqrt(np.mean(v**2)) for v in scene.settings.values() if np.any(v)]
        found = [line(_less_means(one, stretch), scene.time.values * unit, stretch) for one in series]
        best = min((one for one in found if one is not None), key=lambda one: one.p, default=None)
        return None if best is None else Line(best.period, best.unit, min(best.p * len(series), 1.0), best.share)

    @cached_property
    def repeats(self) -> Line | None:
        """The most significant short period with overtones, beside noise with memory; None where none can be told."""
        time = self.data.scene.time
        if time is None or time.presumed or not self.able:
            return None
        at_s = time.values * (time.unit_s or 1.0)
        found = repeats(self.left_under(0), at_s)
        if found is None:
            return None
        under = self._noises()
        best: Line | None = None
        for near in found.periods:
            period, phase = folded(self.left_under(0), at_s, near)
            columns = turns(360.0 * phase / period, HARMONICS)
            block = Block("", columns, ORDERS, np.repeat(np.arange(1.0, HARMONICS + 1), 2))
            each = [one for k in under for one in self._remainders(block, k)]
            p = min(max((one.p for one in each), default=1.0) * found.count, 1.0)
            if each and (best is None or p < best.p):
                best = Line(period, "s", p, each[0].share)
        return best

    @cached_property
    def fine(self) -> Line | None:
        """The clearest fine period over a setting of many different values."""
        settings = {name: v for name, v in self.data.scene.settings.items() if at_levels(v) is v}
        if not self.able or self._coarse:
            return None
        under = self._noises()

        def ask(block: Block) -> Remainder | None:
            each = [one for at in under for one in self._remainders(block, at)]
            return max(each, key=lambda one: one.p, default=None)

        found = [fine_period(self.left_under(0), v, name, ask) for name, v in settings.items()]
        best = min((one for one in found if one is not None), key=lambda one: one.p, default=None)
        return None if best is None else replace(best, p=min(best.p * len(found), 1.0))

    @property
    def _coarse(self) -> bool:
        """Whether the response is rounded to so coarse a step that this alone is a period over each setting."""
        rounded = least_sd(resolution(self.data.y))
        return rounded > COARSE * float(np.sqrt(np.mean((self.left_under(0) * self.judge.problem.sd) ** 2)))

    def _noises(self) -> tuple[int, ...]:
        """Independent rows, the likeliest covariance, and the slowest that is plausible."""
        beside = self.judge.beside(self.chosen)
        return tuple(dict.fromkeys((0, beside.best, beside.slowest_of(np.ones(len(beside.reml), np.bool_)))))

    @cached_property
    def jumps(self) -> TwoLevels | None:
        """Two levels of the residual with jumps between them, if more probable than all noise with memory."""
        when = times_of(self.data)
        if when is None or self.data.scene.time is None or not self.able:
            return None
        return self._jumps_beside(self.chosen, JUMPS)

    def _jumps_beside(self, chosen: tuple[int, ...], ahead: float) -> TwoLevels | None:
        """Two levels beside some of the effects, if `ahead` nats ahead of noise with memory beside all of them."""
        judge, problem, when = self.judge, self.judge.problem, times_of(self.data)
        taken = judge.view(0).taken(chosen)
        y = judge.held(chosen) / problem.sd
        left, n = y - taken @ (taken.T @ y), problem.n
        alike = float(left[1:] @ left[:-1]) / max(float(left @ left), np.finfo(float).tiny)
        if when is None or alike * np.sqrt(n) < ALIKE:
            return None
        found = two_levels(left, taken)
        return found if found is not None and found.log_likelihood - self._usual > ahead else None

    @cached_property
    def _usual(self) -> float:
        """Log-likelihood of the best noise with memory, beside all effects, as `two_levels` counts it."""
        problem, when = self.judge.problem, times_of(self.data)
        assert when is not None  # whoever asks has times
        noise: Noise = Wandering(when) if self.data.shared is None else Both(self.data.shared, when=when)
        y = self.judge.held(self.chosen) / problem.sd
        every = Grid.of(noise.over(problem.sd), y, problem.model(self.chosen) / problem.sd[:, None])
        return float(every.beside().ml.max()) + 0.5 * problem.n * float(np.log(problem.n))

    @cached_property
    def doubts(self) -> dict[str, str]:
        """Reasons for doubt about the names found, by name."""
        if not self.able:
            return {}
        judge, candidates = self.judge, self.judge.candidates
        names = tuple(names_of(candidates, self.chosen))
        out: dict[str, str] = {}
        for name in names:
            effect = next(candidates[j].effect for j in self.chosen if candidates[j].effect.name == name)
            own = set(effect.columns)
            found = self._left_over(own)
            if found is not None:
                out[name] = something_left(found[0].place.block.place, found[1])
            elif self.fine is not None and self.fine.p < CHANGES and self.fine.over in own:
                out[name] = something_left(self.fine.where, self.fine.p)
        jumping = self._timed(names)
        if jumping and self._jumps_beside(self._without(jumping), -EARNED) is not None:
            out |= {name: no_better(jumping, "jumps between two levels along the run") for name in jumping}
        for name in names:
            ahead = judge.beats_wander(self.chosen, name) if name in jumping else None
            if ahead is not None and ahead <= DELTA and name not in out:
                out[name] = no_better((name,), "a slow wander along the run")
        for j in self.chosen:
            effect, profile = candidates[j].effect, candidates[j].term.profile
            if effect.family == "periodic" and effect.source == "time" and profile and profile.value < PERIODS:
                out.setdefault(effect.name, few_periods(profile.value))
        for name in names:
            if (values := self._values_of(name)) > 1:
                out.setdefault(name, several_values(values))
            elif (knots := sum(candidates[j].effect.name == name for j in self._searched)) >= BUNDLE:
                out.setdefault(name, several_values(knots))
        for name, other in self._over_one_variable(names):
            out.setdefault(name, bundle([name, other]))
            out.setdefault(other, bundle([name, other]))
        if len(names) >= BUNDLE:
            out |= {name: bundle(names) for name in names if name not in out}
        if len(names) > 1:
            named, unmodelled, where = self.earned(names)
            if named - unmodelled < EARNED:
                out |= {name: no_better(names, where) for name in names if name not in out}
        for name in names:
            named, unmodelled, where = self.earned((name,))
            if named - unmodelled < (PLAIN if self.plain(name) else EARNED) and name not in out:
                out[name] = no_better((name,), where)
        return out

    @property
    def _searched(self) -> tuple[int, ...]:
        """Those chosen that have a value of a searched constant, periods aside."""
        every = self.judge.candidates
        return tuple(j for j in self.chosen if every[j].term.profile and every[j].effect.family != "periodic")

    def _values_of(self, name: str) -> int:
        """Number of values of the period searched for it; two and three times one frequency are its harmonics."""
        mine = [self.judge.candidates[j] for j in self.chosen if self.judge.candidates[j].effect.name == name]
        found = sorted(c.term.profile.value for c in mine if c.effect.family == "periodic" and c.term.profile)
        return sum(not any(_harmonic(v, first) for first in found[:i]) for i, v in enumerate(found))

    def _over_one_variable(self, names: Sequence[str]) -> Iterator[tuple[str, str]]:
        """Pairs of effects of the same columns, unless both are plain: with a searched constant they take any shape."""
        columns = {self.judge.candidates[j].effect.name: self.judge.candidates[j].effect.columns for j in self.chosen}
        for one, other in combinations(names, 2):
            if set(columns[one]) == set(columns[other]) and not (self.plain(one) and self.plain(other)):
                yield one, other

    def _left_over(self, variables: set[str]) -> tuple[ResidualShape, float] | None:
        """The most significant remainder over variables of an effect, with its p over such places, if it is a doubt."""
        every, own = self._tests(self.places), self._tests(p for p in self.places if p.variables & variables)
        found = next((x for x in self.left if x.place.variables & variables), None)
        p = 1.0 if found is None else found.p * own / max(every, 1)
        return (found, p) if found is not None and found.p < 1.0 and p < DOUBT else None

    def _tests(self, places: Iterable[Place]) -> int:
        return tried(place.block for place in places)

    def _timed(self, names: Sequence[str]) -> tuple[str, ...]:
        """Effects that follow the time or a covariate: random jumps may look like them."""
        sources = {self.judge.candidates[j].effect.name: self.judge.candidates[j].effect.source for j in self.chosen}
        return tuple(name for name in names if sources[name] in ("time", "covariate"))

    def _without(self, names: Sequence[str]) -> tuple[int, ...]:
        return tuple(j for j in self.chosen if self.judge.candidates[j].effect.name not in names)

    def plain(self, name: str) -> bool:
        """Whether it is a line, a square, a cube or levels, without a searched constant or a rare function."""
        own = [c for c in self.judge.candidates if c.effect.name == name]
        return own[0].effect.kind.name not in RARE and all(c.term.profile is None for c in own)

    def earned(self, names: Sequence[str]) -> tuple[float, float, str]:
        """Evidence for effects found, in nats; the best one for a shape without a name; and the place of this shape."""
        judge, candidates = self.judge, self.judge.candidates
        mine = [j for j in self.chosen if candidates[j].effect.name in names]
        rest = tuple(j for j in self.chosen if j not in mine)
        at = judge.beside(self.chosen).best
        view, taken = judge.view(at), judge.view(at).taken(rest)
        left = self.left_under(at)
        df = max(left.size - view.taken(self.chosen).shape[1], 1)
        sigma = float(np.sqrt(left @ left / df))
        y = judge.white(at, self.chosen)
        y = (y - taken @ (taken.T @ y)) / sigma
        picked = (view.picked([j for j in mine if candidates[j].effect.name == name]) for name in names)
        own = (view.columns[:, some] for some in picked)
        named = evidence_of(y, (some - taken @ (taken.T @ some) for some in own)) - sum(map(self._price, names))
        kinds, best, where = sum(1.0 / place.alternatives for place in self.places), -np.inf, ""
        for place in self.places:
            columns = self.white(place.block.columns, at)
            columns = columns - taken @ (taken.T @ columns)
            total = evidence(y, columns, place.block.roughness) - float(np.log(kinds * place.alternatives))
            if total > best:
                best, where = total, place.block.place
        return float(named), float(best), where

    def _price(self, name: str) -> float:
        """Price in nats of the selection of this name, and of its searched constant."""
        candidates = self.judge.candidates
        own = [c for c in candidates if c.effect.name == name]
        names = len({c.effect.name for c in candidates})
        return float(np.log(names) + np.log(len(own)))


def _harmonic(value: float, first: float) -> bool:
    """Whether a frequency is two or three times another one."""
    return any(abs(k * first - value) < NEAR * value for k in (2, 3))


def _less_means(values: FloatArray, group: IntArray) -> FloatArray:
    """(n,) deviations from the mean of each group."""
    count = np.maximum(np.bincount(group), 1)
    return np.asarray(values - (np.bincount(group, values) / count)[group])
