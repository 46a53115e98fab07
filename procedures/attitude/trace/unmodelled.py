"""Smooth shapes without a name in a run, and a comparison of each name found with them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from itertools import combinations

import numpy as np
from scipy import special

from rig.fitter import ties
from rig.fitter.arrays import FloatArray
from rig.fitter.trace.doubts import DOUBT, PERIODS, something_left
from rig.fitter.trace.drawn import drawn, drawn_at
from rig.fitter.trace.flexible import Block, Remainder, evidence, evidence_of, rough_turns, turns
from rig.fitter.trace.lines import CLEAR, Line, lines
from rig.fitter.trace.places import Place
from rig.fitter.trace.search import names_of
from rig.fitter.trace.shape import Axis, Name, Shape
from rig.fitter.trace.unmodelled import Group, Phase, ResidualShape, Seen, Unmodelled, nameless, told
from rig.procedures.attitude.trace.estimate import concerns
from rig.procedures.attitude.trace.fine import fine_of
from rig.procedures.attitude.trace.levels import LEVELS, Level
from rig.procedures.attitude.trace.places import between_replications, places_of
from rig.procedures.attitude.trace.problem import AT_ONCE, Candidate, Problem, raw_columns
from rig.procedures.attitude.trace.score import errors, rounding
from rig.procedures.attitude.trace.view import View
from rig.procedures.attitude.trace.walks import SPREAD, likelihood_ratio

DAY_H = 24.0
SEEN = 6.0
"""Nats of evidence within replications, below which the evidence for an effect is mainly between them."""
DRAWS, SEED = 24, 1
"""Number of draws of white noise, for the share that the projection leaves at each frequency."""
PER_DEG = 1e3
"""Millidegrees in a degree."""
WAVES = 4
"""A turn of pitch and of roll, of a lack of fit that no place shows clearly."""
STRATA: dict[str, str] = {"declared": "replication", "replications": "between-point", "points": "within-point"}
_SEEN = {"replications": "between points, "}


@dataclass(frozen=True, eq=False)
class UnmodelledSmooth(Unmodelled):
    """A run with its findings.

    Attributes:
        problem: the run.
        chosen: candidates in the model.
        outdoes: whether a shape that is left was more probable than names, which are not in the model.

    """

    problem: Problem
    chosen: tuple[int, ...]
    outdoes: bool = False
    _views: dict[str, View] = field(default_factory=dict)
    _without_names: dict[tuple[str, ...], UnmodelledSmooth] = field(default_factory=dict)

    kind = "pitch-roll"
    unit = "mdeg"
    alone = False

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """All candidates."""
        return self.problem.candidates

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
            kept = tuple(j for j in self.chosen if self.candidates[j].effect.name not in names)
            self._without_names[names] = UnmodelledSmooth(self.problem, kept)
        return self._without_names[names]

    def forget(self) -> None:
        """Drop residuals, which take much memory; they are made again if they are asked for."""
        self._views.clear()
        self._without_names.clear()

    def view(self, level: str) -> View:
        """Residuals at a level, beside all that was found."""
        if level not in self._views:
            at: Level = next(one for one in LEVELS if one == level)
            self._views[level] = View(self.problem, at, self.chosen, self.sigma)
        return self._views[level]

    @cached_property
    def memory(self) -> FloatArray:
        """(S,) correlation of neighbouring rows where it is clear, else zero."""
        return _memory(self.problem, self.view(self.problem.levels.of_error).outputs)

    def rows(self, sensor: int | None) -> slice:
        """Rows of a sensor among those of all; None for all."""
        n = len(self.problem.scene.data)
        return slice(None) if sensor is None else slice(sensor * n, (sensor + 1) * n)

    def seen(self, place: Place, i: int) -> Seen:
        """See `Unmodelled`."""
        return self.seen_at(place.level, place.sensor)

    def seen_at(self, level: str, sensor: int | None) -> Seen:
        """The residual of a sensor, or of all, at a level."""
        view, sensors = self.view(level), len(self.sigma) if sensor is None else 1
        y, df = view.outputs.reshape(-1)[self.rows(sensor)], sensors * self.problem.levels.df(view.level)
        project = partial(view.whitened, sensor=sensor, rho=self.memory)
        return Seen(view.white(y, sensor, self.memory), df - len(self.chosen), project)

    def plain(self, place: Place, i: int) -> tuple[FloatArray, FloatArray]:
        """See `Unmodelled`."""
        view, own = self.view(place.level), self.rows(i if place.sensor is None else None)
        slope = self.problem.fits[self.problem.sensors[i]].parameters.S_V
        scale = float(view.sigma[i] * np.degrees(1.0 / slope) * PER_DEG)
        y, columns = view.outputs.reshape(-1)[self.rows(place.sensor)], view.project(place.columns(), place.sensor)
        return y[own] * scale, columns[own] * scale

    def worded(self, place: Place) -> str:
        """See `Unmodelled`."""
        return f"{_SEEN.get(place.level, 'within points, ')}{place.text}"

    def stratum(self, place: Place) -> str:
        """See `Unmodelled`."""
        return STRATA[place.level]

    def held_against(self, place: Place, i: int, one: Remainder) -> float:
        """See `Unmodelled`."""
        return self.against_a_walk(place.level, place.sensor, one.basis)

    def _shape(self, place: Place, i: int, one: Remainder, p: float) -> ResidualShape:
        return ResidualShape(place, one, p, self.worded(place), place.sensor, len(self.problem.sensors))

    def near(self, place: Place, i: int) -> Iterator[Name]:
        """Every cause of which something is left where the shape is seen, beside what was found.

        Of a shape between points only what is judged there: pitch may go with the time of day by the order of running.
        """
        problem, view, rho = self.problem, self.view(place.level), self.memory
        mine = set(problem.concerned[i].tolist()) - set(self.chosen)
        units = [
            unit
            for unit in problem.units
            if mine.issuperset(unit)
            and (place.level != "replications" or problem.judged_at[unit[0]] == place.level)
            and (place.sensor is not None or problem.candidates[unit[0]].sensor is None)
        ]
        n = len(problem.scene.data)
        for start in range(0, len(units), AT_ONCE):
            some = units[start : start + AT_ONCE]
            picked = [j for unit in some for j in unit]
            raw = raw_columns(problem.scene, [problem.candidates[j] for j in picked])
            raw = raw.reshape(-1, len(picked)) if place.sensor is None else raw[place.sensor]
            columns = view.white(view.project(raw, place.sensor), place.sensor, rho)
            sigma = np.repeat(view.sigma, n)[:, None] if place.sensor is None else view.sigma[place.sensor]
            length, k = np.linalg.norm(raw / sigma, axis=0), 0
            for unit in some:
                own = slice(k, k + len(unit))
                yield problem.candidates[unit[0]].effect.name, columns[:, own], length[own]
                k += len(unit)

    def phase(self, found: Line, i: int) -> Phase:
        """See `Unmodelled`."""
        data, level = self.problem.scene.data, self.problem.levels.of_error
        if found.over:
            at = data.pitch_deg if found.over == "pitch" else np.mod(data.roll_deg, 360.0)
            left = self.view("replications").outputs[i]
            return Phase(left, at, found.period, found.unit, "replications")
        left = self.view(level).outputs[i]
        if found.unit == "readings":
            count = np.empty(len(data))
            count[self.problem.levels.executed] = np.arange(len(data))
            return Phase(left, count, found.period, "readings", level)
        return Phase(left, data.elapsed_s / 60.0, found.period / 60.0, "min", level)

    @cached_property
    def lines(self) -> tuple[Line | None, ...]:
        """The most significant period in each sensor's residual, with p over all sensors."""
        problem, data = self.problem, self.problem.scene.data
        level = problem.levels.of_error
        if not self.able:
            return (None,) * len(problem.sensors)
        left = self.view(level).outputs
        rows = problem.levels.executed
        noise = np.random.default_rng(SEED).standard_normal((len(data), DRAWS))
        common = problem.levels.beside == 0
        found = list[Line | None]()
        for group in (left,) if common else left[:, None]:
            own = problem.left(len(found), noise, level)[rows]
            found += lines(group[:, rows], data.elapsed_s[rows], problem.levels.replicate[rows], own)
        return tuple(None if x is None else replace(x, p=min(len(left) * x.p, 1.0)) for x in found)

    @cached_property
    def fine(self) -> Line | None:
        """The clearest fine period over an angle, as an error of the head in all sensors."""
        level = "replications"
        return fine_of(self.problem.scene, self.view(level), self.seen_at(level, None)) if self.able else None

    def left_beside(self, name: str, group: Group) -> str | None:
        """See `Unmodelled`."""
        shares = [concerns(self.problem, j) for j in self.of(name)]
        shown = np.flatnonzero(np.sum(shares, axis=0) > 0.1).tolist()
        at = (x for x in self.left if x.p < DOUBT and (x.place.level == group.level or x.place.remembers))
        why = told(next((x for x in at if any(x.shows_in(i) for i in shown)), None))
        periods = [one for one in self.lines if one is not None and one.p < CLEAR]
        if why is None and periods and any(self.candidates[j].sensor is None for j in self.of(name)):
            period = ties.least(periods, key=lambda one: one.p)  # of all sensors: what one follows, it may be a part of
            return something_left(period.where, period.p)
        fine = self.fine if why is None and group.level == "replications" else None
        return something_left(fine.where, fine.p) if fine is not None and fine.p < CLEAR else why

    def over_one(self, group: Group) -> Iterator[tuple[str, str]]:
        """Pairs of errors of the head over one angle, if one has a searched constant; and a drift and a daily course
        of one quantity, as long as the day has not come back: together they follow any slow course.
        """
        effects = {c.effect.name: c.effect for c in self.candidates if c.effect.name in group.names}
        days = float(np.ptp(self.problem.scene.hours())) / DAY_H
        for one, other in combinations(group.names, 2):
            first, second = effects[one], effects[other]
            if (first.source, first.against) != (second.source, second.against):
                continue
            of_head = first.stratum == second.stratum == "between-point" and (first.searched or second.searched)
            in_time = first.source == "time" and first.scope == second.scope and days < PERIODS
            if of_head or (in_time and first.unit.removesuffix("/h") == second.unit.removesuffix("/h")):
                yield one, other

    def values_of(self, name: str) -> int:
        """Number of values of its searched constant on one sensor, if it is too many for one cause; else 0."""
        mine = self.of(name)
        effect = self.candidates[mine[0]].effect
        units = {(self.candidates[j].sensor, self.problem.unit_of[j]) for j in mine}
        most = max(sum(one == sensor for one, _ in units) for sensor, _ in units)
        return most if effect.searched and most >= (2 if effect.source == "sensor" else 3) else 0

    def several(self, name: str) -> tuple[str, ...]:
        """Sensors that have an effect each for itself, unless it follows the temperature, which all may do."""
        mine = [self.candidates[j] for j in self.of(name)]
        return self.owners(mine) if mine[0].effect.source in ("sensor", "time") else ()

    def groups(self) -> Iterable[Group]:
        """Names found that are seen at one level in sensors that they share."""
        order = list(names_of(self.candidates, self.chosen))
        for level in LEVELS[1:]:
            groups: list[tuple[set[str], set[int]]] = []
            for name in order:
                if self.level_of(name) != level:
                    continue
                shares = np.max([concerns(self.problem, j) for j in self.of(name)], axis=0)
                where = set(np.flatnonzero(shares > 0.05).tolist())
                joined = [group for group in groups if group[1] & where]
                groups = [group for group in groups if not group[1] & where]
                groups.append(({name}.union(*(g[0] for g in joined)), where.union(*(g[1] for g in joined))))
            yield from (Group(tuple(sorted(names, key=order.index)), level) for names, _ in groups)

    def earned(self, names: Sequence[str], group: Group) -> tuple[float, float, str]:
        """See `Unmodelled`.

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
        effect = next(c.effect for c in self.candidates if c.effect.name == name)
        return "replications" if effect.stratum == "between-point" else "points"

    def _named(self, names: Sequence[str], level: Level) -> float:
        """Evidence in nats for effects found, one after the other, less their prices."""
        view, every = self.without_in_view(names, level)
        own = (view.of([j for j in every if self.candidates[j].effect.name == name]) for name in names)
        return evidence_of(view.outputs.reshape(-1), own) - sum(map(self._price, names))

    def _nameless(self, names: Sequence[str], of: Level, level: Level) -> tuple[float, str]:
        """The best evidence for one shape in their place, at a level, over places that are looked at at another one."""
        problem, n = self.problem, len(self.problem.scene.data)
        view, mine = self.without_in_view(names, level)
        y, every = view.outputs.reshape(-1), view.of(mine).reshape(len(problem.sensors), n, -1)
        sensors = [i for i in range(len(problem.sensors)) if np.any(every[i] != 0)]
        by_text: dict[str, list[tuple[Place, int]]] = {}
        for place in (*self.places, *(between_replications(problem.scene) if level == "declared" else ())):
            if place.level == of:
                by_text.setdefault(place.text, []).append((place, place.sensor or 0))

        def weighed(place: Place, i: int) -> float:
            if place.sensor is not None and i not in sensors:
                return 0.0
            return evidence(y[self.rows(place.sensor)], view.project(place.columns(), place.sensor), place.roughness)

        return nameless([*by_text.values()], weighed)

    def without_in_view(self, names: Sequence[str], level: Level) -> tuple[View, list[int]]:
        """The residual beside all but some effects, and their candidates."""
        mine = [j for j in self.chosen if self.candidates[j].effect.name in names]
        return View(self.problem, level, tuple(j for j in self.chosen if j not in mine), self.sigma), mine

    def _price(self, name: str) -> float:
        """Price in nats of the selection of this name, and of its searched constant."""
        first = self.candidates[self.of(name)[0]]
        units = {self.problem.unit_of[j] for j, c in enumerate(self.candidates) if c.cause == first.cause}
        names = len({c.effect.name for c in self.candidates})
        return float(np.log(names) + (np.log(len(units)) if first.effect.searched else 0.0))

    def against_a_walk(self, level: str, sensor: int | None, columns: FloatArray) -> float:
        """P by chance of columns beside a random walk of the offset, with the most probable width."""
        y = self.view(level).outputs
        ys = list(y if sensor is None else y[sensor : sensor + 1])
        xs = list(columns.reshape(len(ys), y.shape[1], -1))
        spread = SPREAD if level == self.problem.levels.of_error else 1.0
        ratio = likelihood_ratio(self.problem.levels.walks(self.view(level).level), ys, xs, spread)
        return float(special.chdtrc(columns.shape[1], max(ratio, 0.0)))

    def drawn_points(self, left: ResidualShape | None, p: float, i: int) -> Shape | None:
        """A lack of fit of sensor `i`, of this p: the clearest shape between points, else waves of pitch and roll."""
        shape = drawn(self, left, i) if left is not None and left.p < DOUBT else None
        scene = self.problem.scene
        if shape is not None:
            return shape
        columns, rough = np.ones((len(scene.data), 1)), np.zeros(1)
        axes = [Axis("pitch_deg", "pitch", "deg", scene.data.pitch_deg, settable=True)]
        if scene.roll:
            axes.append(Axis("roll_deg", "roll", "deg", scene.data.roll_deg, settable=True))
        for axis in axes:
            own = turns(axis.values, WAVES)
            also = rough_turns(own)
            columns = np.column_stack([columns, *(columns * one[:, None] for one in own.T)])
            rough = np.append(rough, np.add.outer(also, rough))
        text = "over pitch and roll" if scene.roll else "over the pitch angle"
        block = Block(text, columns[:, 1:], (columns.shape[1] - 1,), rough[1:])
        over = (axes[0], axes[1] if scene.roll else None)
        return drawn_at(self, Place.of(block, lambda _i: over, level="replications", sensor=i), i, p)

    def drawn_drift(self, p: float, i: int) -> Shape | None:
        """Offsets of the replications of sensor `i`."""
        place = next(one for one in between_replications(self.problem.scene) if one.sensor == i)
        return drawn_at(self, replace(place, level="declared"), i, p)


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
