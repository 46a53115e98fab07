"""Smooth shapes without a name in a whole-plot run, and a comparison of each name found with them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from scipy import special

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.linear import orthonormal
from rig.fitter.trace.doubts import DOUBT, bundle, no_better
from rig.fitter.trace.doubts import beside as small_beside
from rig.fitter.trace.engine.beside import LEVELS, Level, View, White
from rig.fitter.trace.flexible import Remainder, evidence, remainders
from rig.fitter.trace.lines import Line, line
from rig.fitter.trace.places import Place
from rig.fitter.trace.search import names_of
from rig.fitter.trace.shape import Name
from rig.fitter.trace.unmodelled import Group, Phase, ResidualShape, Seen, Unmodelled, nameless, told
from rig.procedures.pressure.effects.scene import TIMES_WARM, PressureScene
from rig.procedures.pressure.trace.between import TINY, alike, p_among
from rig.procedures.pressure.trace.judge import WholePlotJudge
from rig.procedures.pressure.trace.places import places_of
from rig.procedures.pressure.trace.problem import Candidate, Problem

SMALL, ALIKE = 0.05, 0.3
"""Ratio of the evidence of an effect to the evidence of a stronger one, below which it may be an error in the law of
the stronger one: a fifth of its size; and the minimum part of its length along the stronger one."""
ONLY_WARM = "only its change with the temperature was found, and nothing of it that every temperature has"
SLOPES = 3
"""Terms of slopes in a declared model: P, and P times both temperatures."""
_SEEN = {"subplot": "within whole plots", "whole-plot": "between whole plots"}


@dataclass(frozen=True, eq=False)
class UnmodelledSmooth(Unmodelled):
    """A run with its findings.

    Attributes:
        judge: of the run.
        scene: its references, of the same rows.
        chosen: candidates in the model.

    """

    judge: WholePlotJudge
    scene: PressureScene
    chosen: tuple[int, ...]

    kind = "whole-plot"
    unit = "mV"

    @property
    def problem(self) -> Problem:
        """The run."""
        return self.judge.problem

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """All candidates."""
        return self.judge.candidates

    @cached_property
    def white(self) -> White:
        """The run over its errors."""
        return self.judge.white(self.chosen)

    @cached_property
    def places(self) -> tuple[Place, ...]:
        """All places for a remainder."""
        return places_of(self.scene)

    def asked(self, place: Place) -> Iterable[int]:
        """See `Unmodelled`."""
        return range(len(self.problem.sensors))

    @cached_property
    def able(self) -> bool:
        """Whether there is noise for a comparison with shapes."""
        return all(bool(np.all(self.view(level).sigma > 10 * self.white.rounding)) for level in LEVELS)

    def without(self, names: tuple[str, ...]) -> UnmodelledSmooth:
        """See `Unmodelled`."""
        return replace(self, chosen=tuple(j for j in self.chosen if self.candidates[j].effect.name not in names))

    def view(self, level: str) -> View:
        """Residuals at a level, beside all that was found."""
        return self._views[level]

    @cached_property
    def _views(self) -> dict[str, View]:
        return {level: self.white.view(level, self.chosen) for level in LEVELS}

    def seen(self, place: Place, i: int) -> Seen:
        """See `Unmodelled`."""
        view = self.view(place.level)
        return Seen(view.outputs[i], int(view.df[i]), partial(view.project, i=i))

    def plain(self, place: Place, i: int) -> tuple[FloatArray, FloatArray]:
        """See `Unmodelled`."""
        view, (y, _, project) = self.view(place.level), self.seen(place, i)
        errors = view.white.errors[i]
        scale = view.sigma[i] * (errors.sd if place.level == "subplot" else 1.0 / errors.length)
        return y * scale, project(place.columns()) * scale[:, None]

    def near(self, place: Place, i: int) -> Iterator[Name]:
        """Every cause that is judged in the stratum, beside what was found; each value of a constant by itself."""
        problem, view = self.problem, self.view(place.level)
        every = [
            j
            for j, c in enumerate(problem.candidates)
            if problem.judged_at[j] == place.level
            and j not in self.chosen
            and c.sensor in (None, problem.sensors[i])
            and not c.effect.of_noise
        ]
        columns, length = view.of(every, [i]), view.length(problem.raw[i][:, every], i)
        for k, j in enumerate(every):
            yield problem.candidates[j].effect.name, columns[:, [k]], length[[k]]

    def phase(self, found: Line, i: int) -> Phase:
        """See `Unmodelled`: within whole plots."""
        left = self.view("subplot").outputs[i]
        if found.unit == "readings":
            at = np.argsort(np.argsort(self.problem.order)).astype(np.float64)
            return Phase(left, at, found.period, "readings", "subplot")
        return Phase(left, self.scene.data.elapsed_s / 60.0, found.period / 60.0, "min", "subplot")

    def worded(self, place: Place) -> str:
        """See `Unmodelled`."""
        return f"{_SEEN[place.level]}, {place.text}"

    def stratum(self, place: Place) -> str:
        """See `Unmodelled`."""
        return place.level

    @cached_property
    def lines(self) -> tuple[Line | None, ...]:
        """The most significant period in each transducer's residual within whole plots, with p over all transducers."""
        problem, data = self.problem, self.scene.data
        if not self.able:
            return (None,) * len(problem.sensors)
        rows = np.argsort(problem.order)
        every = self.view("subplot").outputs
        found = (line(one[rows], data.elapsed_s[rows], problem.whole_plot[rows]) for one in every)
        return tuple(None if one is None else replace(one, p=min(len(every) * one.p, 1.0)) for one in found)

    def groups(self) -> Iterable[Group]:
        """Names of each transducer and level."""
        every = ((i, level) for i in range(len(self.problem.sensors)) for level in LEVELS)
        each = (Group(self.names_in(i, level), level, i) for i, level in every)
        return (group for group in each if group.names)

    @cached_property
    def doubts_by_sensor(self) -> dict[tuple[str, int], str]:
        """Reasons for doubt about the names found, by name and transducer."""
        out: dict[tuple[str, int], str] = {}
        for group in self.groups() if self.able else ():
            out = {(name, self._at(group)[0]): why for name, why in self.doubts_in(group).items()} | out
        return out

    def left_beside(self, name: str, group: Group) -> str | None:
        """See `Unmodelled`."""
        i, level = self._at(group)
        left = self.left_in(i, level)
        why = told(left)
        return None if why is None or left is None or self._own_constant(left, i, group.names) else why

    def of_kind(self, group: Group) -> Iterator[tuple[Sequence[str], str]]:
        """See `Unmodelled`: names of which only that was found which follows the temperature."""
        sensor = self.problem.sensors[self._at(group)[0]]
        for name in group.names:
            mine = (self.candidates[j] for j in self.of(name))
            if all(c.term.name.endswith(TIMES_WARM) for c in mine if c.sensor in (None, sensor)):
                yield [name], ONLY_WARM

    def several(self, name: str) -> tuple[str, ...]:
        """Transducers that have a drift, a step or an effect of a searched constant each for itself.

        All of one make may be bent or stick alike; that all have the same corner at one pressure is the line's doing,
        and that all drift or jump at once is the doing of what they have in common, whatever jumps in each of them.
        """
        every = [self.candidates[j] for j in self.chosen]
        mine = [c for c in every if c.effect.name == name]
        effect = mine[0].effect
        if effect.source == "interruption" and effect.searched:
            return self.owners(c for c in every if c.effect.source == "interruption" and c.effect.searched)
        return self.owners(mine) if effect.source == "time" or (effect.source == "sensor" and effect.searched) else ()

    def plain_names(self, names: Sequence[str]) -> bool:
        """See `Unmodelled`."""
        return not self._searched({*names})

    def each(self, group: Group) -> dict[str, str]:
        """See `Unmodelled`: also what may be an error in the law of a stronger name."""
        out: dict[str, str] = {}
        weighed = {name: self.earned([name], group) for name in group.names}
        strongest = max(group.names, key=lambda name: weighed[name][0])
        for name, (named, unmodelled, where) in weighed.items():
            if named - unmodelled < self.lead([name]):
                out[name] = no_better([name], where)
            elif name != strongest and self._overlap(name, strongest, group) > ALIKE:
                if named < SMALL * weighed[strongest][0]:
                    out[name] = small_beside(strongest)
                elif where == weighed[strongest][2]:
                    out[name] = bundle([strongest, name])
            elif name != strongest and where == weighed[strongest][2] and self._searched({name, strongest}):
                out[strongest] = out[name] = bundle([strongest, name])
        return out

    def _at(self, group: Group) -> tuple[int, Level]:
        """Transducer and level of a group."""
        return group.sensor or 0, next(level for level in LEVELS if level == group.level)

    def _searched(self, names: AbstractSet[str]) -> bool:
        """Whether a constant is searched for one of these effects: with another effect they can take any shape."""
        return any(c.effect.searched for c in self.candidates if c.effect.name in names)

    def _overlap(self, name: str, other: str, group: Group) -> float:
        """Part of an effect in a transducer that lies along another, of its length beside the declared model."""
        i, level = self._at(group)
        view = self.white.view(level, ())
        one, along = (view.of(self.of(text), [i]) for text in (name, other))
        one, along = (some[:, np.any(some != 0.0, axis=0)] for some in (one, along))
        basis = orthonormal(along)
        return float(np.linalg.norm(basis.T @ one) / max(float(np.linalg.norm(one)), TINY))

    def _own_constant(self, left: ResidualShape, i: int, names: Sequence[str]) -> bool:
        """Whether other values of the constants searched for these names leave nothing there."""
        level = next(one for one in LEVELS if one == left.place.level)
        more = tuple(j for j in self._values(names, i, level) if j not in self.chosen)
        if not more:
            return False
        view = self.white.view(level, (*self.chosen, *more), self.view(level).sigma)
        rest = remainders(view.outputs[i], int(view.df[i]), [left.place.block], partial(view.project, i=i))
        return not rest or rest[0].p * self.tests >= DOUBT

    def _values(self, names: Sequence[str], i: int, level: Level) -> tuple[int, ...]:
        """Candidates for every value of the constants searched for these names, in transducer `i`."""
        problem = self.problem
        own = {(problem.candidates[j].effect.name, problem.candidates[j].sensor) for j in self.chosen}
        return tuple(
            j
            for j, c in enumerate(problem.candidates)
            if c.effect.searched
            and c.effect.name in names
            and (c.effect.name, c.sensor) in own
            and c.sensor in (None, problem.sensors[i])
            and problem.judged_at[j] == level
        )

    def names_in(self, i: int, level: Level) -> tuple[str, ...]:
        """Effects found that are judged at a level and show in transducer `i`, those about the noise apart."""
        problem, sensor = self.problem, self.problem.sensors[i]
        mine = [
            j
            for j in self.chosen
            if problem.judged_at[j] == level
            and problem.candidates[j].sensor in (None, sensor)
            and not problem.candidates[j].effect.of_noise
        ]
        return tuple(names_of(problem.candidates, tuple(mine)))

    def earned(self, names: Sequence[str], group: Group) -> tuple[float, float, str]:
        """See `Unmodelled`. An effect of the line is judged in all transducers."""
        problem, (i, level) = self.problem, self._at(group)
        mine = [j for j in self.chosen if problem.candidates[j].effect.name in names and problem.judged_at[j] == level]
        mine = [j for j in mine if problem.candidates[j].sensor in (None, problem.sensors[i])]
        rest = tuple(j for j in self.chosen if j not in mine)
        of_line = any(problem.candidates[j].sensor is None for j in mine)
        sensors = list(range(len(problem.sensors))) if of_line else [i]
        view = self.white.view(level, rest, self.view(level).sigma)
        y = view.outputs[sensors].reshape(-1)
        left, taken, named = y, np.empty((y.size, 0)), 0.0
        for name in names:
            raw = view.of([j for j in mine if problem.candidates[j].effect.name == name], sensors)
            own = raw - taken @ (taken.T @ raw)
            alone = evidence(left, own) - self._price(name, level)
            values = self._values([name], i, level)
            if values:  # a constant between those tried shows in several
                every = view.of(values, sensors)
                both = evidence(left, every - taken @ (taken.T @ every)) - self._price(name, level, searched=False)
                alone = max(alone, both)
            named += alone
            basis = orthonormal(own, np.linalg.norm(raw, axis=0), 1e-4)
            left, taken = left - basis @ (basis.T @ left), np.column_stack([taken, basis])
        at = [[(place, k) for k in sensors] for place in self.places if place.level == level]

        def weighed(place: Place, k: int) -> float:
            return evidence(view.outputs[k], view.project(place.columns(), k), place.roughness)

        return float(named), *nameless(at, weighed)

    def _price(self, name: str, level: Level, *, searched: bool = True) -> float:
        """Price in nats of the selection of this name, and of its searched constant."""
        problem = self.problem
        at = problem.within(level, range(len(problem.candidates)))
        names = {problem.candidates[j].effect.name for j in at}
        effect = next(c.effect for c in problem.candidates if c.effect.name == name)
        terms = {problem.candidates[j].term.name for j in at if problem.candidates[j].effect.name == name}
        return float(np.log(len(names)) + (0.5 * np.log(max(len(terms), 1)) if searched and effect.searched else 0.0))

    def held_against(self, place: Place, i: int, one: Remainder) -> float:
        """P by chance with correlated neighbouring whole plots, or with a new sensitivity in each whole plot."""
        if place.level == "whole-plot":
            view = self.view(place.level)
            return p_among(alike(view, self.problem.plots_in_time, i), one.basis, view.outputs[i])
        return self.among_slopes(i, one.basis) if place.slopes else 0.0

    def of_repeats(self, repeats: IntArray, i: int, level: Level) -> float:
        """P by chance of what groups of rows of a level in transducer `i` differ by, as their errors are.

        Readings that remember one another differ by less than they scatter, where repeats follow at once; and where
        each whole plot draws its own sensitivity, readings of different ones differ by more.

        Args:
            repeats: (n,) group number of each reading.
            i: the transducer.
            level: of rows that should agree within its error.

        """
        view = self.view(level)
        groups = (np.arange(int(repeats.max()) + 1) == repeats[:, None]).astype(np.float64)
        length, groups = view.length(groups, i), view.project(groups, i)
        slopes = view.white.errors[i].slopes if level == "subplot" and "P" in self.problem.names else groups[:, :0]
        return max(_p_of(groups, length, own, view.outputs[i], view.df[i]) for own in (slopes[:, :0], slopes))

    def among_slopes(self, i: int, basis: FloatArray) -> float:
        """P of a basis (n, q) by the slopes of whole plots, where these scatter by more than readings explain.

        Zero where they do not.
        """
        view = self.view("subplot")
        errors = view.white.errors[i]
        if not errors.slopes_differ:
            return 0.0
        slopes, own = errors.slopes.T @ view.outputs[i], errors.slopes.T @ basis
        own = orthonormal(own, np.ones(own.shape[1]), 0.05)
        gain, q = float(np.sum((own.T @ slopes) ** 2)), own.shape[1]
        below = slopes.size - SLOPES - q
        if below < 1 or q < 1:
            return 1.0
        return float(special.fdtrc(q, below, gain / q / (max(float(slopes @ slopes) - gain, TINY) / below)))


def _p_of(groups: FloatArray, length: FloatArray, own: FloatArray, left: FloatArray, df: float) -> float:
    """P by chance of what columns (n, m), once this long, take up of a residual (n,) beside others (n, r)."""
    beside = orthonormal(own)
    left, groups = left - beside @ (beside.T @ left), groups - beside @ (beside.T @ groups)
    basis = orthonormal(groups, length, 1e-3)
    q = basis.shape[1]
    below = df - beside.shape[1] - q
    if q < 1 or below < 1:
        return 1.0
    gain = float(np.sum((basis.T @ left) ** 2))
    return float(special.fdtrc(q, below, gain / q / max((float(left @ left) - gain) / below, TINY)))
