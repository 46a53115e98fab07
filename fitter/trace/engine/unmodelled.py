"""Shapes without a name in one sensor, and a comparison of each name found with them, beside the likeliest error.

Where the error has components of groups, rows are looked at in two levels of the same residual: one number of each
group, and rows beside the offset of their group. So few groups count as few.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from itertools import combinations
from typing import Any, NamedTuple, Self

import numpy as np
from scipy import special

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.linear import orthonormal, spanned
from rig.fitter.trace.doubts import BUNDLE
from rig.fitter.trace.engine.beside import LEVELS, Errors, View, White
from rig.fitter.trace.engine.between import TINY, alike, p_among
from rig.fitter.trace.engine.judge import TableJudge
from rig.fitter.trace.engine.problem import Candidate
from rig.fitter.trace.flexible import Block, Remainder, evidence, remainders
from rig.fitter.trace.places import Place
from rig.fitter.trace.search import names_of
from rig.fitter.trace.shape import Name
from rig.fitter.trace.unmodelled import Group, Seen, Unmodelled, nameless

NEAR = 0.05
"""Share by which a frequency may differ from twice or three times another one, as its harmonic."""


class Beside(NamedTuple):
    """A residual beside some effects, over its error.

    Attributes:
        y: (m,) it, of unit variance.
        project: removes the model from columns, and gives them in that metric.

    """

    y: FloatArray
    project: Callable[[FloatArray], FloatArray]


@dataclass(frozen=True, eq=False)
class InSensor(Unmodelled):
    """One sensor with its findings.

    Attributes:
        judge: of the sensor at the end of the search.
        chosen: candidates in the model.

    """

    judge: TableJudge
    chosen: tuple[int, ...]
    _views: dict[Any, View] = field(default_factory=dict, kw_only=True)

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """All candidates."""
        return self.judge.candidates

    @cached_property
    def able(self) -> bool:
        """Whether the residual is more than rounding."""
        left = self.left_under(0)
        return float(left @ left) > self.judge.view(0).rounding

    @cached_property
    def at(self) -> tuple[int, int]:
        """The likeliest covariance, and the slowest that is plausible."""
        beside = self.judge.beside(self.chosen)
        return beside.best, beside.slowest_of(np.ones(len(beside.reml), np.bool_))

    def without(self, names: tuple[str, ...]) -> Self:
        """See `Unmodelled`."""
        return replace(self, chosen=self._without(names))

    def _without(self, names: Sequence[str]) -> tuple[int, ...]:
        return tuple(j for j in self.chosen if self.candidates[j].effect.name not in names)

    # Levels of groups.

    @property
    def levels(self) -> Sequence[str]:
        """Levels at which names are judged; one, "", where the error has no groups."""
        return ("",)

    def level_of(self, j: int) -> str:
        """Level at which a candidate is judged."""
        return ""

    @property
    def in_time(self) -> IntArray:
        """(W,) groups in the order of running."""
        return np.arange(0)

    def view(
        self,
        level: str = "",
        chosen: tuple[int, ...] | None = None,
        sigma: FloatArray | None = None,
        at: int | None = None,
    ) -> View:
        """Rows, or those at a level of groups, beside all that was found or some candidates.

        Args:
            level: of `levels`; "" for all rows.
            chosen: candidates in the model; None for all that were found.
            sigma: error that counts as one; None for that beside these candidates.
            at: covariance; None for the likeliest one.
        """
        chosen, at = self.chosen if chosen is None else chosen, self.at[0] if at is None else at
        key = level, chosen, self.chosen, at, None if sigma is None else float(sigma[0])
        if key not in self._views:
            problem = self.judge.problem
            errors, y = Errors(problem.noise.only(at), problem.sd), self.judge.held(self.chosen)
            white = White((errors,), problem.declared, y[None], problem.of(chosen)[None])
            of_level = next((one for one in LEVELS if one == level), None)
            self._views[key] = white.view(of_level, range(white.columns.shape[2]), sigma)
        return self._views[key]

    @property
    def slopes(self) -> int:
        """Terms of slopes of groups in the declared model."""
        return 0

    def among_slopes(self, basis: FloatArray) -> float:
        """P of a basis (n, q) of rows within groups by their slopes, where these scatter by more than rows explain.

        Zero where they do not.
        """
        view = self.view("subplot")
        errors = view.white.errors[0]
        if not errors.slopes_differ:
            return 0.0
        slopes, own = errors.slopes.T @ view.outputs[0], errors.slopes.T @ basis
        own = orthonormal(own, np.ones(own.shape[1]), 0.05)
        gain, q = float(np.sum((own.T @ slopes) ** 2)), own.shape[1]
        below = slopes.size - self.slopes - q
        if below < 1 or q < 1:
            return 1.0
        return float(special.fdtrc(q, below, gain / q / (max(float(slopes @ slopes) - gain, TINY) / below)))

    # Residuals.

    def seen(self, place: Place, i: int) -> Seen:
        """See `Unmodelled`."""
        return self.seen_at(place.level)

    def seen_at(self, level: str = "", at: int | None = None) -> Seen:
        """The residual at a level, under the likeliest covariance or another one."""
        view = self.view(level, at=at)
        return Seen(view.outputs[0], int(view.df[0]), partial(view.project, i=0))

    def plain(self, place: Place, i: int) -> tuple[FloatArray, FloatArray]:
        """See `Unmodelled`: of independent rows, or of groups."""
        view = self.view(place.level, at=None if place.level else 0)
        rows = place.level != "whole-plot"
        size = view.sigma[0] * (self.judge.problem.sd if rows else 1.0 / view.white.errors[0].length)
        return view.outputs[0] * size, view.project(place.columns(), 0) * size[:, None]

    def held_against(self, place: Place, i: int, one: Remainder) -> float:
        """See `Unmodelled`; between groups with neighbours in time that are alike."""
        if not place.level:
            at, slow = self.at
            return 0.0 if slow == at else self.p_of(place.block, slow) or 0.0
        if place.level == "subplot":
            return self.among_slopes(one.basis) if place.slopes else 0.0
        view = self.view(place.level)
        return p_among(alike(view, self.in_time, 0), one.basis, view.outputs[0])

    def near(self, place: Place, i: int) -> Iterator[Name]:
        """See `Unmodelled`: every candidate beside what was found."""
        others = [j for j in range(len(self.candidates)) if j not in self.chosen and self.level_of(j) == place.level]
        others = [j for j in others if self.candidates[j].effect.stratum != "noise"]
        view, every = self.view(place.level), self.judge.problem.of(others)
        columns, length = view.project(every, 0), view.length(every - every.mean(axis=0), 0)
        first = 0
        for j in others:
            last = first + self.candidates[j].term.columns.shape[1]
            yield self.candidates[j].effect.name, columns[:, first:last], length[first:last]
            first = last

    def p_of(self, block: Block, at: int) -> float | None:
        """P by chance of a block beside the model, under covariance `at`; None if nothing is left of it."""
        left = self.seen_at(at=at).remainder(block)
        return None if left is None else left.p

    def remainders(self, block: Block, seen: Seen) -> list[Remainder]:
        """The remainder of a block."""
        return remainders(seen.y, seen.df, [block], seen.project) if seen.df > 2 else []

    def left_under(self, at: int) -> FloatArray:
        """(n,) residual, whitened by covariance `at`."""
        white, taken = self.judge.white(at, self.chosen), self.judge.view(at).taken(self.chosen)
        return np.asarray(white - taken @ (taken.T @ white))

    def white(self, columns: FloatArray, at: int) -> FloatArray:
        """(n, m) columns whitened by covariance `at`."""
        problem = self.judge.problem
        return np.asarray(problem.noise.whiten(np.array([at]), columns / problem.sd[:, None])[0])

    def beside(self, rest: tuple[int, ...], level: str) -> Beside:
        """The residual beside some of the effects found, over the error beside all of them."""
        view = self.view(level, rest, self.view(level).sigma)
        return Beside(view.outputs[0], partial(view.project, i=0))

    # Reasons for doubt.

    def groups(self) -> Iterable[Group]:
        """Names of each level."""
        return [Group(names, level) for level in self.levels if (names := self.names_at(level))]

    def names_at(self, level: str) -> tuple[str, ...]:
        """Effects found that are judged at a level, those about the noise apart."""
        mine = (j for j in self.chosen if self.level_of(j) == level and self.candidates[j].effect.stratum != "noise")
        return tuple(names_of(self.candidates, tuple(mine)))

    def plain_names(self, names: Sequence[str]) -> bool:
        """See `Unmodelled`: a smooth curve begins with a line or a square."""
        return len(names) == 1 and self.plain_name(names[0])

    def plain_name(self, name: str) -> bool:
        """Whether it is a line, a square, a cube or levels, without a searched constant or a rare function."""
        own = [c for c in self.candidates if c.effect.name == name]
        return not self.rare(own[0].effect) and all(c.term.profile is None for c in own)

    def rare(self, effect: Any) -> bool:
        """Whether many functions are similar to an effect's."""
        return False

    def values_of(self, name: str) -> int:
        """Number of values of a searched constant; two and three times one frequency are its harmonics."""
        mine = [self.candidates[j] for j in self.of(name)]
        found = sorted(c.term.profile.value for c in mine if c.effect.family == "periodic" and c.term.profile)
        count = sum(not any(_harmonic(v, first) for first in found[:i]) for i, v in enumerate(found))
        knots = sum(c.term.profile is not None and c.effect.family != "periodic" for c in mine)
        return count if count > 1 else knots if knots >= BUNDLE else 0

    def over_one(self, group: Group) -> Iterator[tuple[str, str]]:
        """Pairs of effects of the same columns, unless both are plain: with a searched constant they take any shape."""
        columns = {self.candidates[j].effect.name: set(self.candidates[j].effect.columns) for j in self.chosen}
        for one, other in combinations(group.names, 2):
            if columns[one] == columns[other] and not (self.plain_name(one) and self.plain_name(other)):
                yield one, other

    def together(self, names: Sequence[str]) -> Sequence[InSensor]:
        """Sensors in which some names are judged at once: those that have them with one coefficient."""
        return (self,)

    def earned(self, names: Sequence[str], group: Group) -> tuple[float, float, str]:
        """See `Unmodelled`."""
        level, sensors = group.level, self.together(names)
        each = [one.beside(one._without(names), level) for one in sensors]
        y = np.concatenate([one.y for one in each])
        left, taken, named = y, np.empty((y.size, 0)), 0.0
        for name in names:
            own = self._stacked([one.columns_of(name, level) for one in sensors], name, each)
            own, price = own - taken @ (taken.T @ own), self._price(name, level)
            earned = evidence(left, own) - price
            if any(values := [one.values(name, level) for one in sensors]):  # one between those tried shows in several
                every = self._stacked([o.judge.problem.of(v) for o, v in zip(sensors, values, strict=True)], name, each)
                whole = evidence(left, every - taken @ (taken.T @ every)) - price + self.tried(name)
                earned = max(earned, whole)
            named += earned
            basis = orthonormal(own, None, 1e-6)
            left, taken = left - basis @ (basis.T @ left), np.column_stack([taken, basis])

        def weighed(place: Place, k: int) -> float:
            own = each[k].project(place.columns())
            if len(each) == 1 and spanned(own, taken):  # levels of a group are its offsets: that has a name
                return -np.inf
            return evidence(each[k].y, own, place.roughness)

        at = [[(place, k) for k in range(len(each))] for place in self.places if place.level == level]
        return float(named), *nameless(at, weighed)

    def columns_of(self, name: str, level: str) -> FloatArray:
        """(n, d) of a name in the model, as far as it is judged at a level."""
        return self.judge.problem.of([j for j in self.of(name) if self.level_of(j) == level])

    def values(self, name: str, level: str) -> tuple[int, ...]:
        """Candidates for all values of the constant of a name, where none is searched between those tried."""
        return ()

    def _stacked(self, parts: Sequence[FloatArray], name: str, each: Sequence[Beside]) -> FloatArray:
        """Columns of a name in several sensors: one for all of what has one coefficient there."""
        parts = [beside.project(columns) for columns, beside in zip(parts, each, strict=True)]
        if len(parts) == 1 or all(self.candidates[j].sensor is None for j in self.of(name)):
            return np.concatenate(parts)
        ends = np.cumsum([(0, 0), *(part.shape for part in parts)], axis=0)
        out = np.zeros(ends[-1])
        for part, (row, column) in zip(parts, ends, strict=False):
            out[row : row + len(part), column : column + part.shape[1]] = part
        return out

    def _price(self, name: str, level: str) -> float:
        """Price in nats of the selection of this name, and of its searched constant."""
        every = {c.effect.name for j, c in enumerate(self.candidates) if self.level_of(j) == level}
        return float(np.log(len(every))) + self.tried(name)

    def tried(self, name: str) -> float:
        """Price in nats of the values of a searched constant, or of other terms, of which the best one was taken."""
        return float(np.log(sum(c.effect.name == name for c in self.candidates)))


def _harmonic(value: float, first: float) -> bool:
    """Whether a frequency is two or three times another one."""
    return any(abs(k * first - value) < NEAR * value for k in (2, 3))
