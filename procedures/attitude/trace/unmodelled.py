"""Smooth shapes without a name in a run, and a comparison of each name found with them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from itertools import combinations

import numpy as np
from scipy import special

from rig.fitter.arrays import FloatArray
from rig.fitter.trace.doubts import BUNDLE, DOUBT, bundle, in_several, no_better, several_values, something_left
from rig.fitter.trace.flexible import Remainder, evidence, evidence_of, remainders
from rig.fitter.trace.limits import limit
from rig.fitter.trace.lines import CLEAR, Line, lines
from rig.fitter.trace.search import names_of
from rig.procedures.attitude.trace.estimate import concerns
from rig.procedures.attitude.trace.fine import fine_of
from rig.procedures.attitude.trace.levels import LEVELS, Level
from rig.procedures.attitude.trace.places import Place, between_replications, places_of
from rig.procedures.attitude.trace.problem import Problem
from rig.procedures.attitude.trace.score import errors, rounding
from rig.procedures.attitude.trace.view import View
from rig.procedures.attitude.trace.walks import SPREAD, likelihood_ratio

EARNED = limit("lead of a name", "pitch-roll")
SEEN = 6.0
"""Nats of evidence within replications, below which the evidence for an effect is mainly between them."""
DRAWS, SEED = 24, 1
"""Number of draws of white noise, for the share that the projection leaves at each frequency."""
WALKED = 0.05
"""Probability above which a shape is not tested against a random walk too."""


@dataclass(frozen=True, eq=False)
class ResidualShape:
    """A shape that a residual still follows.

    Attributes:
        place: its place.
        remainder: its part of the residual.
        p: over all places, orders and sensors.

    """

    place: Place
    remainder: Remainder
    p: float

    def shows_in(self, i: int) -> bool:
        """Whether sensor `i` has a part in it."""
        if self.place.sensor is not None:
            return self.place.sensor == i
        n = self.remainder.shape.size // self.place.count
        square = np.sum(self.remainder.shape.reshape(-1, n) ** 2, axis=1)
        return bool(square[i] > 0.1 * square.max())

    @property
    def where(self) -> str:
        """Its place in words, with its level."""
        level = "between points" if self.place.level == "replications" else "within points"
        return f"{level}, {self.place.text}"


@dataclass(frozen=True, eq=False)
class UnmodelledSmooth:
    """A run with its findings.

    Attributes:
        problem: the run.
        chosen: candidates in the model.

    """

    problem: Problem
    chosen: tuple[int, ...]
    _views: dict[Level, View] = field(default_factory=dict)
    _without_names: dict[tuple[str, ...], UnmodelledSmooth] = field(default_factory=dict)

    @cached_property
    def places(self) -> tuple[Place, ...]:
        """All places for a remainder; where no point is visited twice, none is within points."""
        level = self.problem.levels.of_error
        every = places_of(self.problem.scene)
        return tuple(replace(one, level=level) if one.level == "points" else one for one in every)

    @cached_property
    def sigma(self) -> FloatArray:
        """(S,) error of each sensor beside the findings, V."""
        return errors(self.problem, self.chosen)

    @cached_property
    def able(self) -> bool:
        """Whether the residual is more than rounding."""
        return bool(np.all(self.sigma > 10 * rounding(self.problem)))

    def without(self, names: tuple[str, ...]) -> UnmodelledSmooth:
        """The same run beside all effects found but those of some names."""
        if names not in self._without_names:
            kept = tuple(j for j in self.chosen if self.problem.candidates[j].effect.name not in names)
            self._without_names[names] = UnmodelledSmooth(self.problem, kept)
        return self._without_names[names]

    def view(self, level: Level) -> View:
        """Residuals at a level, beside all that was found."""
        if level not in self._views:
            self._views[level] = View(self.problem, level, self.chosen, self.sigma)
        return self._views[level]

    @cached_property
    def memory(self) -> FloatArray:
        """(S,) correlation of neighbouring rows where it is clear, else zero."""
        return _memory(self.problem, self.view(self.problem.levels.of_error).outputs)

    @cached_property
    def left(self) -> tuple[ResidualShape, ...]:
        """Places that the residual follows, the most significant first."""
        if not self.able:
            return ()
        problem, n = self.problem, len(self.problem.scene.data)
        count = sum(len(place.orders) for place in self.places)
        found = []
        rho = self.memory
        for place in self.places:
            view = self.view(place.level)
            at = slice(None) if place.sensor is None else slice(place.sensor * n, (place.sensor + 1) * n)
            y = view.outputs.reshape(-1)[at]
            df = y.size // n * problem.levels.df(place.level) - len(self.chosen)
            if df < 3:
                continue
            project = partial(view.whitened, sensor=place.sensor, rho=rho)
            for one in remainders(view.white(y, place.sensor, rho), df, [place.block], project):
                p = one.p
                if p * count < WALKED:
                    p = max(p, self.against_a_walk(place.level, y, one.basis))
                # without the basis: those of all places would be a fifth of all memory of a trace
                found.append(ResidualShape(place, replace(one, basis=np.empty((0, 0))), min(p * count, 1.0)))
        return tuple(sorted(found, key=lambda one: one.p))

    def left_in(self, i: int, level: Level | None = None) -> ResidualShape | None:
        """The most significant remainder of one sensor, at one level or any."""
        sensors = (None, i)
        own = (x for x in self.left if x.place.sensor in sensors and level in (None, x.place.level) and x.shows_in(i))
        return next(own, None)

    @cached_property
    def lines(self) -> tuple[Line | None, ...]:
        """The most significant period in each sensor's residual, with p over all sensors."""
        problem, data = self.problem, self.problem.scene.data
        level = problem.levels.of_error
        if not self.able:
            return (None,) * len(problem.sensors)
        left = self.view(level).outputs
        rows = problem.levels.executed
        drawn = np.random.default_rng(SEED).standard_normal((len(data), DRAWS))
        common = problem.levels.beside == 0
        found = list[Line | None]()
        for group in (left,) if common else left[:, None]:
            noise = problem.left(len(found), drawn, level)[rows]
            found += lines(group[:, rows], data.elapsed_s[rows], problem.levels.replicate[rows], noise)
        return tuple(None if x is None else replace(x, p=min(len(left) * x.p, 1.0)) for x in found)

    @cached_property
    def fine(self) -> Line | None:
        """The clearest fine period over an angle, as an error of the head in all sensors."""
        df = len(self.sigma) * self.problem.levels.df("replications") - len(self.chosen)
        return fine_of(self.problem.scene, self.view("replications"), self.memory, df) if self.able else None

    @cached_property
    def doubts(self) -> dict[str, str]:
        """Reasons for doubt about the names found, by name."""
        if not self.able:
            return {}
        out: dict[str, str] = {}
        for level, names in self._groups:
            for name in names:
                found = self._left_beside(name, level)
                if found is not None:
                    out[name] = something_left(found.place.text, found.p)
                elif self._common(name) and (period := self._period) is not None:
                    out[name] = something_left(period.where, period.p)
                elif level == "replications" and self.fine is not None and self.fine.p < CLEAR:
                    out[name] = something_left(self.fine.where, self.fine.p)
            if len(names) >= BUNDLE:
                out |= {name: bundle(names) for name in names if name not in out}
            for one, other in self._over_one_angle(names):
                out |= {name: bundle([one, other]) for name in (one, other) if name not in out}
            for name in names:
                values = self._values_of(name)
                if values and name not in out:
                    out[name] = several_values(values)
                sensors = self._own_of(name)
                if len(sensors) > 1 and name not in out:
                    out[name] = in_several(sensors)
            named, unmodelled, where = self.earned(names)
            if named - unmodelled < EARNED:
                out |= {name: no_better(names, where) for name in names if name not in out}
        return out

    def _over_one_angle(self, names: Sequence[str]) -> Iterator[tuple[str, str]]:
        """Pairs of errors of the head over one angle, if one has a searched constant: together they take any shape."""
        effects = {c.effect.name: c.effect for c in self.problem.candidates if c.effect.name in names}
        for one, other in combinations(names, 2):
            first, second = effects[one], effects[other]
            same = (first.source, first.against) == (second.source, second.against)
            if same and first.stratum == second.stratum == "between-point" and (first.searched or second.searched):
                yield one, other

    def _values_of(self, name: str) -> int:
        """Number of values of its searched constant on one sensor, if it is too many for one cause; else 0."""
        mine = self._of(name)
        effect = self.problem.candidates[mine[0]].effect
        units = {(self.problem.candidates[j].sensor, self.problem.unit_of[j]) for j in mine}
        most = max(sum(one == sensor for one, _ in units) for sensor, _ in units)
        return most if effect.searched and most >= (2 if effect.source == "sensor" else 3) else 0

    def _own_of(self, name: str) -> tuple[str, ...]:
        """Sensors that have an effect each for itself, unless it follows the temperature, which all may do."""
        mine = [self.problem.candidates[j] for j in self._of(name)]
        if mine[0].effect.source not in ("sensor", "time"):
            return ()
        return tuple(dict.fromkeys(c.sensor for c in mine if c.sensor is not None))

    def _common(self, name: str) -> bool:
        """Whether it is one cause of all sensors: what one of them still follows, it may be a part of."""
        return any(self.problem.candidates[j].sensor is None for j in self._of(name))

    def _of(self, name: str) -> list[int]:
        """Candidates in the model of one name."""
        return [j for j in self.chosen if self.problem.candidates[j].effect.name == name]

    @cached_property
    def _period(self) -> Line | None:
        """The clearest period that a sensor's residual still has."""
        every = [one for one in self.lines if one is not None and one.p < CLEAR]
        return min(every, key=lambda one: one.p, default=None)

    def _left_beside(self, name: str, level: Level) -> ResidualShape | None:
        problem = self.problem
        mine = self._of(name)
        shown = np.flatnonzero(sum((concerns(problem, j) for j in mine), np.zeros(len(problem.sensors))) > 0.1)
        at = [one for one in self.left if one.p < DOUBT and (one.place.level == level or one.place.remembers)]
        return next((x for x in at if any(x.place.sensor in (None, i) and x.shows_in(i) for i in shown.tolist())), None)

    @cached_property
    def _groups(self) -> tuple[tuple[Level, tuple[str, ...]], ...]:
        """Names found that are seen at one level in sensors that they share."""
        problem = self.problem
        out: list[tuple[Level, tuple[str, ...]]] = []
        for level in LEVELS[1:]:
            groups: list[tuple[set[str], set[int]]] = []
            for name in names_of(problem.candidates, self.chosen):
                mine = self._of(name)
                if self.level_of(name) != level:
                    continue
                where = set(np.flatnonzero(np.max([concerns(problem, j) for j in mine], axis=0) > 0.05).tolist())
                joined = [group for group in groups if group[1] & where]
                groups = [group for group in groups if not group[1] & where]
                groups.append(({name}.union(*(g[0] for g in joined)), where.union(*(g[1] for g in joined))))
            order = list(names_of(problem.candidates, self.chosen))
            out += [(level, tuple(sorted(names, key=order.index))) for names, _ in groups]
        return tuple(out)

    def earned(self, names: Sequence[str]) -> tuple[float, float, str]:
        """Evidence for effects found, in nats; the best for one shape without a name; and where that lives.

        What is hardly seen within replications was found between them: there it is weighed, beside offsets and
        sensitivities that differ from one to the next.
        """
        level = self.level_of(names[0])
        named = self._named(names, level)
        if level == "points" and named < SEEN:
            return self._named(names, "declared"), *self._nameless(names, level, "declared")
        return named, *self._nameless(names, level, level)

    def level_of(self, name: str) -> Level:
        """Level of an effect; an effect of time remains one if the order of running hides it within points."""
        effect = next(c.effect for c in self.problem.candidates if c.effect.name == name)
        return "replications" if effect.stratum == "between-point" else "points"

    def _named(self, names: Sequence[str], level: Level) -> float:
        """Evidence in nats for effects found, one after the other, less their prices."""
        view, every = self.without_in_view(names, level)
        own = (view.of([j for j in every if self.problem.candidates[j].effect.name == name]) for name in names)
        return evidence_of(view.outputs.reshape(-1), own) - sum(map(self._price, names))

    def _nameless(self, names: Sequence[str], of: Level, level: Level) -> tuple[float, str]:
        """The best evidence in nats for one shape without a name in their place, and where that lives.

        Args:
            names: effects found.
            of: level of the places that are looked at.
            level: at which what is there is weighed.

        """
        problem, n = self.problem, len(self.problem.scene.data)
        view, mine = self.without_in_view(names, level)
        y, every = view.outputs.reshape(-1), view.of(mine).reshape(len(problem.sensors), n, -1)
        sensors = [i for i in range(len(problem.sensors)) if np.any(every[i] != 0)]
        by_text: dict[str, dict[int | None, Place]] = {}
        for place in (*self.places, *(between_replications(problem.scene) if level == "declared" else ())):
            if place.level == of:
                by_text.setdefault(place.text, {})[place.sensor] = place
        alike = {text: next(iter(at.values())).alternatives for text, at in by_text.items()}
        kinds, best, where = sum(1.0 / count for count in alike.values()), -np.inf, ""
        for text, at in by_text.items():
            total = -float(np.log(kinds * alike[text]))
            for i, place in at.items():
                if i is None or i in sensors:
                    rows = slice(None) if i is None else slice(i * n, (i + 1) * n)
                    total += evidence(y[rows], view.project(place.columns(), i), place.roughness)
            if total > best:
                best, where = total, text
        return best, where

    def without_in_view(self, names: Sequence[str], level: Level) -> tuple[View, list[int]]:
        """The residual beside all but some effects, and their candidates."""
        mine = [j for j in self.chosen if self.problem.candidates[j].effect.name in names]
        return View(self.problem, level, tuple(j for j in self.chosen if j not in mine), self.sigma), mine

    def _price(self, name: str) -> float:
        """Price in nats of the selection of this name, and of its searched constant."""
        candidates = self.problem.candidates
        effect = next(c.effect for c in candidates if c.effect.name == name)
        sensor = next(candidates[j].sensor for j in self.chosen if candidates[j].effect.name == name)
        units = {self.problem.unit_of[j] for j, c in enumerate(candidates) if c.cause == (name, sensor)}
        names = len({c.effect.name for c in candidates})
        return float(np.log(names) + (np.log(len(units)) if effect.searched else 0.0))

    def against_a_walk(self, level: Level, y: FloatArray, columns: FloatArray) -> float:
        """P by chance of columns beside a random walk of the offset, with the most probable width."""
        n = len(self.problem.scene.data)
        ys = list(y.reshape(-1, n))
        xs = list(columns.reshape(len(ys), n, -1))
        spread = SPREAD if level == self.problem.levels.of_error else 1.0
        ratio = likelihood_ratio(self.problem.levels.walks(level), ys, xs, spread)
        return float(special.chdtrc(columns.shape[1], max(ratio, 0.0)))


def _memory(problem: Problem, left: FloatArray) -> FloatArray:
    """(S,) correlation of neighbouring rows if it is significant, else zero."""
    rows, replicate = problem.levels.executed, problem.levels.replicate
    same = np.diff(replicate[rows]) == 0
    out = np.zeros(len(left))
    for i, one in enumerate(left):
        e = one[rows]
        square = float(e @ e)
        if square <= 0 or same.sum() < 16:
            continue
        r = float(np.sum(e[1:][same] * e[:-1][same])) / square
        if r * np.sqrt(same.sum()) > 3.0:
            out[i] = min(r, 0.95)
    return out
