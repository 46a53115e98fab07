"""All that is known of a run after its search, and the reasons for doubt about its names."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial

from rig.fitter.arrays import FloatArray
from rig.fitter.formula import Formula
from rig.fitter.trace.aliases import Rival
from rig.fitter.trace.doubts import (
    MANY,
    another_law,
    beyond_chance,
    by_chance,
    one_apart,
    several_causes,
    shown_by_another,
    something_left,
    under_another_name,
)
from rig.fitter.trace.engine.beside import LEVELS, Level, View
from rig.fitter.trace.engine.constant import Constant
from rig.fitter.trace.limits import limit
from rig.fitter.trace.search import led_by_history
from rig.fitter.trace.signs import Refused
from rig.procedures.pressure.data import WholePlotData
from rig.procedures.pressure.effects.scene import PressureScene
from rig.procedures.pressure.trace.agreement import classes
from rig.procedures.pressure.trace.courses import Course, courses
from rig.procedures.pressure.trace.estimate import Estimate
from rig.procedures.pressure.trace.judge import WholePlotJudge
from rig.procedures.pressure.trace.places import OF_PLOTS, changing_with
from rig.procedures.pressure.trace.result import FoundPressureEffect
from rig.procedures.pressure.trace.settle import Settled
from rig.procedures.pressure.trace.unmodelled import InTransducer, transducers

UNEXPLAINED = limit("unexplained", "whole-plot")
"""Probability of a remainder, over all that is tried, below which it is said."""
QUADRATIC = ("offset-temperature", "offset-temperature-second-order", "sensitivity-temperature")
"""Terms of the usual quadratic model: where one is missing, it is likelier than any corner that looks like it."""


@dataclass(frozen=True, eq=False)
class Run:
    """All results of a trace of a run.

    Attributes:
        data: the observations.
        model: the declared one, as requested.
        formula: its terms.
        scene: references.
        settled: the search, with its final weights, and the noise with the effects.
        before: the declared model.
        after: the same with the effects.
        stated: the same as it is stated, see `left_to_plots`.
        cv: (2, S) error of left-out whole plots, before and after.
        refused: causes that would fit, except for their required sign.
    """

    data: WholePlotData
    model: str
    formula: Formula
    scene: PressureScene
    settled: Settled
    before: Estimate
    after: Estimate
    stated: Estimate
    cv: FloatArray | None
    refused: tuple[Refused, ...] = ()

    @property
    def judge(self) -> WholePlotJudge:
        """The judge of the search."""
        return self.settled.judge

    @cached_property
    def classes(self) -> dict[str, tuple[Rival, ...]]:
        """Every explanation of each effect found."""
        return classes(self.judge, self.after.chosen)

    @cached_property
    def led_by_history(self) -> dict[str, str]:
        """Sentences about names that a laboratory's history puts before others."""
        return led_by_history(self.judge, self.after.chosen, self.judge.lead)

    @cached_property
    def unmodelled(self) -> list[InTransducer]:
        """Each transducer with shapes without a name beside what was found."""
        return transducers(self.judge, self.scene, self.after.chosen)

    def view(self, level: Level) -> View:
        """A level of all transducers beside what was found."""
        return self.judge.white(self.after.chosen).view(level, self.after.chosen)

    def free(self, level: Level, i: int) -> float:
        """Degrees of freedom of a level of transducer `i` beside the declared model."""
        return float(self.judge.white(self.after.chosen).view(level, ()).df[i])

    @cached_property
    def constant(self) -> Constant:
        """Whether the coefficients of what was found are constants."""
        variables = changing_with(self.scene)
        return Constant(self.unmodelled, variables, OF_PLOTS)

    @cached_property
    def courses(self) -> dict[int, Course]:
        """What whole plots follow beside what was found, by transducer."""
        if not all(one.able for one in self.unmodelled):
            return {}
        return courses(self.view("whole-plot"), self.judge.problem.plots_in_time, self.scene)


def doubt(run: Run, effect: FoundPressureEffect, i: int) -> str | None:
    """Why a name found in transducer `i` should not be believed yet; None where nothing is against it.

    A name that is doubtful in one transducer is so in all: it is one cause, and they are of one make and on one line.
    """
    every = (_doubt_in(run, effect.effect, k) for k in (i, *range(len(run.judge.problem.sensors))))
    said = next((text for text in every if text is not None), _alike_laws(run, effect.effect))
    said = said or of_another(run.unmodelled, effect.effect, i)
    said = said or of_alias(run.unmodelled, effect.aliases, i, partial(_doubt_in, run))
    tried = len(run.judge.candidates)
    if effect.p_adjusted_is_bound and beyond_chance(effect.coefficients, effect.stderr, min(effect.df), tried):
        return said
    return said or by_chance(effect.p_adjusted)


def _alike_laws(run: Run, name: str) -> str | None:
    """Doubt about a name beside which many others explain as much, or a corner over a temperature beside a power."""
    candidates = run.judge.problem.candidates
    rivals = [r for r in run.classes[name] if r.alias and r.effect != name]
    if len(rivals) >= MANY:
        return several_causes(len(rivals) + 1)
    own = next(c.effect for c in candidates if c.effect.name == name)
    effects = [candidates[rival.terms[0]].effect for rival in rivals]
    if any(effect.of_noise for effect in effects) and not own.of_noise:
        return one_apart()
    corners = [effect.name for effect in effects if effect.searched and effect.source == "temperature"]
    return another_law(corners[0]) if corners and not own.searched and name not in QUADRATIC else None


def _doubt_in(run: Run, name: str, i: int) -> str | None:
    """Why a name should not be believed in transducer `i`."""
    problem, course = run.judge.problem, run.courses.get(i)
    said = run.led_by_history.get(name) or run.unmodelled[i].doubts.get(name)
    if said is None:
        said = run.constant.doubts.get(name)
    between = any(
        problem.judged_at[j] == "whole-plot" and problem.candidates[j].sensor in (None, problem.sensors[i])
        for j in run.after.chosen
        if problem.candidates[j].effect.name == name
    )
    if said is None and between and course is not None and not course.slow:
        return something_left(course.where, course.shape.p)
    return said


def of_another(unmodelled: Sequence[InTransducer], name: str, i: int) -> str | None:
    """Doubt about a name of transducer `i` where another one, without it, follows a shape in the same stratum.

    They are of one make and on one line, so that one cause of both is likelier than two.
    """
    for level in LEVELS:
        having = [k for k, one in enumerate(unmodelled) if name in one.names_at(level)]
        for k, one in enumerate(unmodelled):
            left = one.left_in(0, level) if i in having and k not in having else None
            if left is not None and left.p < UNEXPLAINED:
                return shown_by_another(one.run.sensors[k], left.place.text)
    return None


def of_alias(
    unmodelled: Sequence[InTransducer], aliases: Sequence[str], i: int, doubt: Callable[[str, int], str | None]
) -> str | None:
    """Doubt about a name of transducer `i` of which another one has an alias, where that is doubtful.

    Args:
        unmodelled: the run with its findings.
        aliases: of the name.
        i: the transducer.
        doubt: of a name in a transducer.

    """
    for k, one in enumerate(unmodelled):
        for other in (name for level in LEVELS for name in one.names_at(level) if k != i):
            if other in aliases and doubt(other, k) is not None:
                return under_another_name(one.run.sensors[k], other)
    return None
