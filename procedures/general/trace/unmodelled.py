"""Shapes without a name in a table, and a comparison of each name found with them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from rig.fitter import ties
from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.resolution import least_sd, resolution
from rig.fitter.trace.aliases import DELTA
from rig.fitter.trace.doubts import CHANGES, DOUBT, PERIODS, few_periods, no_better, something_left
from rig.fitter.trace.engine.both import Both
from rig.fitter.trace.engine.likelihood import Grid
from rig.fitter.trace.engine.noise import Noise, Wandering
from rig.fitter.trace.engine.unmodelled import InSensor
from rig.fitter.trace.fine_periods import fine_period
from rig.fitter.trace.flexible import Block, Remainder, turns
from rig.fitter.trace.limits import limit
from rig.fitter.trace.lines import Line, folded, line
from rig.fitter.trace.places import Place
from rig.fitter.trace.repeats import HARMONICS, ORDERS, repeats
from rig.fitter.trace.two_levels import TwoLevels, two_levels
from rig.fitter.trace.unmodelled import Group, Phase, ResidualShape
from rig.procedures.general.effects.scene import at_levels
from rig.procedures.general.trace.places import PER_COLUMN, axes_over, places_of
from rig.procedures.general.trace.run import TableData, times_of
from rig.procedures.general.trace.together import together

ALIKE = 2.0
"""Correlation of neighbours in standard errors, from which on two levels are searched."""
EARNED = limit("lead of a name", "general")
RARE = ("fourth-order", "fifth-order", "logarithm", "reciprocal", "square-root", "ageing", "drift-second-order")
"""Kinds that need the same lead as kinds with a searched constant, because many functions are similar to them."""
COARSE = 0.5
"""Error of rounding over that of a row from which fine periods over settings are those of the rounding."""
JUMPS = 7.0
"""Minimum lead in nats of two levels over every noise with memory."""


@dataclass(frozen=True, eq=False)
class UnmodelledSmooth(InSensor):
    """A table with its findings.

    Attributes:
        data: the table.

    """

    data: TableData

    kind = "general"
    unit = ""

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
                    axes = axes_over(self.data.scene, *effect.columns)
                    yield Place.of(block, axes, variables=frozenset(effect.columns))

    def stratum(self, place: Place) -> str:
        """See `Unmodelled`."""
        return "row"

    def phase(self, found: Line, i: int) -> Phase | None:
        """See `Unmodelled`."""
        scene, left = self.data.scene, self.left_under(0)
        if found.over:
            return Phase(left, scene.of(found.over), found.period, found.unit)
        if scene.time is None:
            return None
        if found.unit == "readings":
            number = np.argsort(np.argsort(scene.time.values, kind="stable")).astype(np.float64)
            return Phase(left, number, found.period, "rows")
        return Phase(left, scene.time.values * (scene.time.unit_s or 1.0), found.period, "s")

    @property
    def harmonics(self) -> int:
        """See `Unmodelled`."""
        return min(super().harmonics, self.judge.problem.n // (2 * PER_COLUMN))

    def _followed(self) -> Iterator[ResidualShape]:
        yield from super()._followed()
        one = together(self.judge, self.chosen, self.data)  # of all recorded quantities jointly
        if one is not None:
            n = self.judge.problem.n
            none = Remainder(one.place.text, one.p, 0.0, 0, one.share, np.zeros(n), np.empty((n, 0)))
            yield ResidualShape(one.place, none, one.p, one.place.text, 0, detail=one.detail)

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
        seen = [one for one in found if one is not None]
        best = ties.least(seen, key=lambda one: one.p) if seen else None
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
            each = [one for k in under for one in self.remainders(block, self.seen_at(at=k))]
            p = min(max((one.p for one in each), default=1.0) * found.count, 1.0)
            if each and (best is None or ties.below(p, best.p, 0.0)):
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
            each = [one for at in under for one in self.remainders(block, self.seen_at(at=at))]
            return ties.least(each, key=lambda one: -one.p) if each else None

        found = [fine_period(self.left_under(0), v, name, ask) for name, v in settings.items()]
        seen = [one for one in found if one is not None]
        best = ties.least(seen, key=lambda one: one.p) if seen else None
        return None if best is None else replace(best, p=min(best.p * len(found), 1.0))

    @property
    def _coarse(self) -> bool:
        """Whether the response is rounded to so coarse a step that this alone is a period over each setting."""
        rounded = least_sd(resolution(self.data.y))
        return rounded > COARSE * float(np.sqrt(np.mean((self.left_under(0) * self.judge.problem.sd) ** 2)))

    def _noises(self) -> tuple[int, ...]:
        """Independent rows, the likeliest covariance, and the slowest that is plausible."""
        return tuple(dict.fromkeys((0, *self.at)))

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

    def left_beside(self, name: str, group: Group) -> str | None:
        """See `Unmodelled`."""
        own = set(self.candidates[self.of(name)[0]].effect.columns)
        if self.of_levels(name):  # a curve that all levels share says nothing of whether they differ
            own &= {*self.data.scene.groups, *self.data.scene.labels}
        found = self._left_over(own)
        if found is not None:
            return something_left(found[0].place.text, found[1])
        fine = self.fine is not None and self.fine.p < CHANGES and self.fine.over in own
        return something_left(self.fine.where, self.fine.p) if fine and self.fine is not None else None

    def of_kind(self, group: Group) -> Iterator[tuple[Sequence[str], str]]:
        """See `Unmodelled`: what goes with time may be jumps, a wander, or a wave that did not come back."""
        jumping = self._timed(group.names)
        if jumping and self._jumps_beside(self._without(jumping), -EARNED) is not None:
            yield jumping, no_better(jumping, "jumps between two levels along the run")
        for name in jumping:
            ahead = self.judge.beats_wander(self.chosen, name)
            if ahead is not None and ahead <= DELTA:
                yield [name], no_better((name,), "a slow wander along the run")
        for j in self.chosen:
            effect, profile = self.candidates[j].effect, self.candidates[j].term.profile
            if effect.family == "periodic" and effect.source == "time" and profile and profile.value < PERIODS:
                yield [effect.name], few_periods(profile.value)

    def of_levels(self, name: str) -> bool:
        """See `Unmodelled`."""
        return bool(self.candidates[self.of(name)[0]].effect.family == "group")

    def rare(self, effect: Any) -> bool:
        """See `InSensor`."""
        return effect.kind.name in RARE

    def _left_over(self, variables: set[str]) -> tuple[ResidualShape, float] | None:
        """The most significant remainder over variables of an effect, with its p over such places, if it is a doubt."""
        own = sum(len(place.orders) for place in self.places if place.variables & variables)
        found = next((x for x in self.left if x.place.variables & variables), None)
        p = 1.0 if found is None else found.p * own / max(self.tests, 1)
        return (found, p) if found is not None and found.p < 1.0 and p < DOUBT else None

    def _timed(self, names: Sequence[str]) -> tuple[str, ...]:
        """Effects that follow the time or a covariate: random jumps may look like them."""
        sources = {self.judge.candidates[j].effect.name: self.judge.candidates[j].effect.source for j in self.chosen}
        return tuple(name for name in names if sources[name] in ("time", "covariate"))


def _less_means(values: FloatArray, group: IntArray) -> FloatArray:
    """(n,) deviations from the mean of each group."""
    count = np.maximum(np.bincount(group), 1)
    return np.asarray(values - (np.bincount(group, values) / count)[group])
