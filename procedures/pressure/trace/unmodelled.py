"""Transducers of a whole-plot run with their findings, and what is doubtful about these."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from rig.fitter.arrays import IntArray
from rig.fitter.trace.doubts import DOUBT
from rig.fitter.trace.engine.beside import LEVELS
from rig.fitter.trace.engine.unmodelled import InSensor
from rig.fitter.trace.flexible import remainders
from rig.fitter.trace.lines import Line, line
from rig.fitter.trace.places import Place
from rig.fitter.trace.unmodelled import Group, Phase, ResidualShape, told
from rig.procedures.pressure.effects.scene import TIMES_WARM, PressureScene
from rig.procedures.pressure.trace.judge import WholePlotJudge
from rig.procedures.pressure.trace.places import places_of
from rig.procedures.pressure.trace.problem import Problem

ONLY_WARM = "only its change with the temperature was found, and nothing of it that every temperature has"
SLOPES = 3
"""Terms of slopes in a declared model: P, and P times both temperatures."""
_SEEN = {"subplot": "within whole plots", "whole-plot": "between whole plots"}


@dataclass(frozen=True, eq=False)
class InTransducer(InSensor):
    """A transducer with its findings.

    Attributes:
        run: of all transducers.
        scene: references of its columns, of the same rows.
        where: all places for a remainder.
        numbers: of its candidates in the run.
        found: candidates of the run in the model.
        every: all transducers, one after the other.

    """

    run: Problem
    scene: PressureScene
    where: tuple[Place, ...]
    numbers: IntArray
    found: tuple[int, ...]
    every: list[InTransducer]

    kind = "whole-plot"
    unit = "mV"
    levels = LEVELS
    slopes = SLOPES

    @property
    def places(self) -> tuple[Place, ...]:
        """See `Unmodelled`."""
        return self.where

    @property
    def in_time(self) -> IntArray:
        """See `InSensor`."""
        return self.run.plots_in_time

    def level_of(self, j: int) -> str:
        """See `InSensor`."""
        return self.run.judged_at[int(self.numbers[j])]

    @cached_property
    def tests(self) -> int:
        """See `Unmodelled`: over all transducers."""
        return super().tests * len(self.run.sensors)

    def together(self, names: Sequence[str]) -> Sequence[InTransducer]:
        """See `InSensor`: all transducers for an effect of the line."""
        of_line = any(self.candidates[j].sensor is None for name in names for j in self.of(name))
        return self.every if of_line else (self,)

    def phase(self, found: Line, i: int) -> Phase:
        """See `Unmodelled`: within whole plots."""
        left = self.view("subplot").outputs[0]
        if found.unit == "readings":
            at = np.argsort(np.argsort(self.run.order)).astype(np.float64)
            return Phase(left, at, found.period, "readings", "subplot")
        return Phase(left, self.scene.data.elapsed_s / 60.0, found.period / 60.0, "min", "subplot")

    def worded(self, place: Place) -> str:
        """See `Unmodelled`."""
        return f"{_SEEN[place.level]}, {place.text}"

    def stratum(self, place: Place) -> str:
        """See `Unmodelled`."""
        return place.level

    @cached_property
    def line(self) -> Line | None:
        """The most significant period in the residual within whole plots, with p over all transducers."""
        if not self.able:
            return None
        rows = np.argsort(self.run.order)
        found = line(self.view("subplot").outputs[0][rows], self.scene.data.elapsed_s[rows], self.run.whole_plot[rows])
        return None if found is None else replace(found, p=min(len(self.run.sensors) * found.p, 1.0))

    def left_beside(self, name: str, group: Group) -> str | None:
        """See `Unmodelled`."""
        left = self.left_in(0, group.level)
        return None if left is None or self._own_constant(left, group) else told(left)

    def of_kind(self, group: Group) -> Iterator[tuple[Sequence[str], str]]:
        """See `Unmodelled`: names of which only that was found which follows the temperature."""
        for name in group.names:
            if all(self.candidates[j].term.name.endswith(TIMES_WARM) for j in self.of(name)):
                yield [name], ONLY_WARM

    def several(self, name: str) -> tuple[str, ...]:
        """Transducers that have a drift, a step or an effect of a searched constant each for itself.

        All of one make may be bent or stick alike; that all have the same corner at one pressure is the line's doing,
        and that all drift or jump at once is the doing of what they have in common, whatever jumps in each of them.
        """
        every = [self.run.candidates[j] for j in self.found]
        mine = [c for c in every if c.effect.name == name]
        effect = mine[0].effect
        if effect.source == "interruption" and effect.searched:
            return self.owners(c for c in every if c.effect.source == "interruption" and c.effect.searched)
        return self.owners(mine) if effect.source == "time" or (effect.source == "sensor" and effect.searched) else ()

    def tried(self, name: str) -> float:
        """See `InSensor`: values of the catalogue are alike, and as good as half as many nats."""
        terms = {c.term.name for c in self.candidates if c.effect.name == name}
        return 0.0 if self.plain_name(name) else 0.5 * float(np.log(len(terms)))

    def plain_names(self, names: Sequence[str]) -> bool:
        """See `Unmodelled`."""
        return all(map(self.plain_name, names))

    def values(self, name: str, level: str) -> tuple[int, ...]:
        """See `InSensor`: of transducers that have it."""
        own = {self.candidates[j].sensor for j in self.of(name)}
        return tuple(
            j
            for j, c in enumerate(self.candidates)
            if c.effect.name == name and c.effect.searched and c.sensor in own and self.level_of(j) == level
        )

    def _own_constant(self, left: ResidualShape, group: Group) -> bool:
        """Whether other values of the constants searched for names of a group leave nothing of a shape."""
        more = tuple(j for name in group.names for j in self.values(name, group.level) if j not in self.chosen)
        if not more:
            return False
        view = self.view(group.level, (*self.chosen, *more), self.view(group.level).sigma)
        rest = remainders(view.outputs[0], int(view.df[0]), [left.place.block], partial(view.project, i=0))
        return not rest or rest[0].p * self.tests >= DOUBT


def transducers(judge: WholePlotJudge, scene: PressureScene, chosen: tuple[int, ...]) -> list[InTransducer]:
    """All transducers of a run with their findings.

    Args:
        judge: of the run at the end of the search.
        scene: its references, of the same rows.
        chosen: candidates in the model.
    """
    every: list[InTransducer] = []
    where = places_of(scene)
    for i in range(len(judge.problem.sensors)):
        own, numbers = judge.table(i)
        mine = tuple(int(np.flatnonzero(numbers == j)[0]) for j in chosen if j in numbers)
        every.append(InTransducer(own, mine, judge.problem, scene, where, numbers, chosen, every))
    return every
