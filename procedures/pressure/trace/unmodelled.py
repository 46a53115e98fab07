"""Smooth shapes without a name in a whole-plot run, and a comparison of each name found with them."""

from __future__ import annotations

from collections.abc import Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from scipy import special

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.linear import orthonormal
from rig.fitter.trace.doubts import BUNDLE, DOUBT, bundle, in_several, no_better, something_left
from rig.fitter.trace.doubts import beside as small_beside
from rig.fitter.trace.engine.beside import LEVELS, Level, View, White
from rig.fitter.trace.flexible import Remainder, evidence, remainders, tried
from rig.fitter.trace.found import Unnamed
from rig.fitter.trace.limits import limit
from rig.fitter.trace.lines import Line, line
from rig.fitter.trace.search import names_of
from rig.procedures.pressure.effects.scene import TIMES_WARM, PressureScene
from rig.procedures.pressure.trace.between import TINY, alike, p_among
from rig.procedures.pressure.trace.judge import WholePlotJudge
from rig.procedures.pressure.trace.places import Place, places_of
from rig.procedures.pressure.trace.problem import Problem

EARNED = limit("lead of a name", "whole-plot")
PLAIN = limit("lead of a plain name", "whole-plot")
"""Minimum lead in nats of a name with a searched constant, and of one without."""
SMALL, ALIKE = 0.05, 0.3
"""Ratio of the evidence of an effect to the evidence of a stronger one, below which it may be an error in the law of
the stronger one: a fifth of its size; and the minimum part of its length along the stronger one."""
ONLY_WARM = "only its change with the temperature was found, and nothing of it that every temperature has"
SLOPES = 3
"""Terms of slopes in a declared model: P, and P times both temperatures."""
LOOKED_AT = limit("asked again", "whole-plot")
"""Probability above which a shape is not tested against noise that is correlated between neighbouring whole plots."""
_SEEN: dict[Level, str] = {"subplot": "within whole plots", "whole-plot": "between whole plots"}


@dataclass(frozen=True, eq=False)
class ResidualShape:
    """A shape that a residual still follows.

    Attributes:
        place: its place.
        remainder: its part of the residual.
        sensor: index of the transducer.
        p: over all places, orders and transducers.

    """

    place: Place
    remainder: Remainder
    sensor: int
    p: float

    def unnamed(self) -> Unnamed:
        """The shape for the report."""
        return Unnamed(f"{_SEEN[self.place.level]}, {self.place.block.place}", self.remainder.share)


@dataclass(frozen=True, eq=False)
class UnmodelledSmooth:
    """A run with its findings.

    Attributes:
        judge: of the run.
        scene: its references, of the same rows.
        chosen: candidates in the model.

    """

    judge: WholePlotJudge
    scene: PressureScene
    chosen: tuple[int, ...]

    @property
    def problem(self) -> Problem:
        """The run."""
        return self.judge.problem

    @cached_property
    def white(self) -> White:
        """The run over its errors."""
        return self.judge.white(self.chosen)

    @cached_property
    def places(self) -> tuple[Place, ...]:
        """All places for a remainder."""
        return places_of(self.scene)

    @cached_property
    def able(self) -> bool:
        """Whether there is noise for a comparison with shapes."""
        return all(bool(np.all(self.view(level).sigma > 10 * self.white.rounding)) for level in LEVELS)

    @cached_property
    def left(self) -> tuple[ResidualShape, ...]:
        """Places that residuals follow, the most significant first."""
        if not self.able:
            return ()
        problem = self.problem
        count = tried(place.block for place in self.places) * len(problem.sensors)
        found = []
        for place in self.places:
            view = self.view(place.level)
            for i in range(len(problem.sensors)):
                df = int(view.df[i])
                if df < 3:
                    continue
                project = partial(view.project, i=i)
                for one in remainders(view.outputs[i], df, [place.block], project):
                    p = one.p
                    if p * count < LOOKED_AT:
                        p = max(p, self._held_against(place, i, one, view))
                    found.append(ResidualShape(place, one, i, min(p * count, 1.0)))
        return tuple(sorted(found, key=lambda one: one.p))

    def left_in(self, i: int, level: Level) -> ResidualShape | None:
        """The most significant remainder of transducer `i` at a level."""
        return next((one for one in self.left if one.sensor == i and one.place.level == level), None)

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

    @cached_property
    def doubts(self) -> dict[tuple[str, int], str]:
        """Reasons for doubt about the names found, by name and transducer."""
        if not self.able:
            return {}
        out: dict[tuple[str, int], str] = {}
        for i in range(len(self.problem.sensors)):
            for level in LEVELS:
                names = self.names_in(i, level)
                left = self.left_in(i, level)
                if left is not None and left.p < DOUBT and not self._own_constant(left, names):
                    out |= {(name, i): something_left(left.place.block.place, left.p) for name in names}
                for name in names:
                    if self._only_warm(name, i) and (name, i) not in out:
                        out[name, i] = ONLY_WARM
                    sensors = self._own_of(name)
                    if len(sensors) > 1 and (name, i) not in out:
                        out[name, i] = in_several(sensors)
                if len(names) >= BUNDLE:
                    out |= {(name, i): bundle(names) for name in names if (name, i) not in out}
                if names and any((name, i) not in out for name in names):
                    named, unmodelled, where = self.earned(names, i, level)
                    if named - unmodelled < self._asked(names):
                        out |= {(name, i): no_better(names, where) for name in names if (name, i) not in out}
                if len(names) > 1:
                    out |= {(name, i): why for name, why in self._each(names, i, level).items() if (name, i) not in out}
        return out

    def _own_of(self, name: str) -> tuple[str, ...]:
        """Transducers that have a drift, a step or an effect of a searched constant each for itself.

        All of one make may be bent or stick alike; that all have the same corner at one pressure is the line's doing,
        and that all drift or jump at once is the doing of what they have in common, whatever jumps in each of them.
        """
        mine = [c for j in self.chosen if (c := self.problem.candidates[j]).effect.name == name]
        effect = mine[0].effect
        if effect.source == "interruption" and effect.searched:
            every = (self.problem.candidates[j] for j in self.chosen)
            mine = [c for c in every if c.effect.source == "interruption" and c.effect.searched]
        elif effect.source != "time" and not (effect.source == "sensor" and effect.searched):
            return ()
        return tuple(dict.fromkeys(c.sensor for c in mine if c.sensor is not None))

    def _only_warm(self, name: str, i: int) -> bool:
        """Whether of an effect that follows the temperature only that was found in transducer `i`."""
        every = (self.problem.candidates[j] for j in self.chosen)
        mine = [c.term.name for c in every if c.effect.name == name and c.sensor in (None, self.problem.sensors[i])]
        return all(text.endswith(TIMES_WARM) for text in mine)

    def _each(self, names: Sequence[str], i: int, level: Level) -> dict[str, str]:
        """Reasons for doubt about single names of several, each beside the others."""
        out: dict[str, str] = {}
        evidence_of = {name: self.earned([name], i, level) for name in names}
        strongest = max(names, key=lambda name: evidence_of[name][0])
        for name, (named, unmodelled, where) in evidence_of.items():
            if named - unmodelled < self._asked([name]):
                out[name] = no_better([name], where)
            elif name != strongest and self._overlap(name, strongest, i, level) > ALIKE:
                if named < SMALL * evidence_of[strongest][0]:
                    out[name] = small_beside(strongest)
                elif where == evidence_of[strongest][2]:
                    out[name] = bundle([strongest, name])
            elif name != strongest and where == evidence_of[strongest][2] and self._searched({name, strongest}):
                out[strongest] = out[name] = bundle([strongest, name])
        return out

    def _asked(self, names: Sequence[str]) -> float:
        """Minimum lead of some names over a shape without one."""
        return EARNED if self._searched({*names}) else PLAIN

    def _searched(self, names: AbstractSet[str]) -> bool:
        """Whether a constant is searched for one of these effects: with another effect they can take any shape."""
        return any(c.effect.searched for c in self.problem.candidates if c.effect.name in names)

    def _overlap(self, name: str, other: str, i: int, level: Level) -> float:
        """Part of an effect in transducer `i` that lies along another, of its length beside the declared model."""
        problem, view = self.problem, self.white.view(level, ())
        one, along = (
            view.of([j for j in self.chosen if problem.candidates[j].effect.name == text], [i])
            for text in (name, other)
        )
        one, along = (some[:, np.any(some != 0.0, axis=0)] for some in (one, along))
        basis = orthonormal(along)
        return float(np.linalg.norm(basis.T @ one) / max(float(np.linalg.norm(one)), TINY))

    def _own_constant(self, left: ResidualShape, names: Sequence[str]) -> bool:
        """Whether other values of the constants searched for these names leave nothing there."""
        beside = (
            *self.chosen,
            *(j for j in self._values(names, left.sensor, left.place.level) if j not in self.chosen),
        )
        if len(beside) == len(self.chosen):
            return False
        i, view = left.sensor, self.white.view(left.place.level, beside, self.view(left.place.level).sigma)
        rest = remainders(view.outputs[i], int(view.df[i]), [left.place.block], partial(view.project, i=i))
        count = tried(place.block for place in self.places) * len(self.problem.sensors)
        return not rest or rest[0].p * count >= DOUBT

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

    def earned(self, names: Sequence[str], i: int, level: Level) -> tuple[float, float, str]:
        """Evidence for effects in transducer `i`, in nats; the best for one shape without a name; where that lives.

        An effect of the line is judged in all transducers.
        """
        problem = self.problem
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
        best, where = -np.inf, ""
        at = [place for place in self.places if place.level == level]
        for place in at:
            total = -float(np.log(len(at)))
            for k in sensors:
                total += evidence(view.outputs[k], view.project(place.block.columns, k), place.block.roughness)
            if total > best:
                best, where = total, place.block.place
        return float(named), float(best), where

    def _price(self, name: str, level: Level, *, searched: bool = True) -> float:
        """Price in nats of the selection of this name, and of its searched constant."""
        problem = self.problem
        at = problem.within(level, range(len(problem.candidates)))
        names = {problem.candidates[j].effect.name for j in at}
        effect = next(c.effect for c in problem.candidates if c.effect.name == name)
        terms = {problem.candidates[j].term.name for j in at if problem.candidates[j].effect.name == name}
        return float(np.log(len(names)) + (0.5 * np.log(max(len(terms), 1)) if searched and effect.searched else 0.0))

    def _held_against(self, place: Place, i: int, one: Remainder, view: View) -> float:
        """P by chance with correlated neighbouring whole plots, or with a new sensitivity in each whole plot."""
        if place.level == "whole-plot":
            return self.p_among(i, one.basis)
        return self._among_slopes(i, one.basis, view) if place.slopes else 0.0

    def p_among(self, i: int, basis: FloatArray) -> float:
        """P by chance of a basis (W, q) between whole plots whose errors may be like those of their neighbours."""
        view = self.view("whole-plot")
        return p_among(alike(view, self.problem.plots_in_time, i), basis, view.outputs[i])

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
        """P by chance of a basis (n, q) within whole plots beside the scatter of their slopes; zero without any."""
        return self._among_slopes(i, basis, self.view("subplot"))

    def _among_slopes(self, i: int, basis: FloatArray, view: View) -> float:
        """P of a basis (n, q) by the slopes of whole plots, where these scatter by more than readings explain."""
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

    def view(self, level: Level) -> View:
        """Residuals at a level, beside all that was found."""
        return self._views[level]

    @cached_property
    def _views(self) -> dict[Level, View]:
        return {level: self.white.view(level, self.chosen) for level in LEVELS}


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
