"""The whole trace, from the residual to the effect."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.errors import FitError
from rig.fitter.steps import steps
from rig.fitter.trace.engine.family import TableFamily
from rig.fitter.trace.found import explanations_of
from rig.fitter.trace.keep import groups_of, kept, left_in
from rig.fitter.trace.not_kept import NotKept
from rig.fitter.trace.refusals import refusals
from rig.fitter.trace.search import ROUNDS, led_by_history, names_of, prune, search_and_name
from rig.procedures.attitude.data import AttitudeData
from rig.procedures.attitude.effects import CATALOGUE, Effect
from rig.procedures.attitude.effects.unnamed import UNNAMED
from rig.procedures.attitude.trace.agreement import supported
from rig.procedures.attitude.trace.alternatives import alternatives
from rig.procedures.attitude.trace.constant import doubts_of
from rig.procedures.attitude.trace.estimate import concerns, estimate, stated
from rig.procedures.attitude.trace.findings import left_without_a_name, residual_of, sensor_trace
from rig.procedures.attitude.trace.judge import AttitudeJudge
from rig.procedures.attitude.trace.make_problem import make_problem
from rig.procedures.attitude.trace.noise import alone
from rig.procedures.attitude.trace.outdone import outdone_in
from rig.procedures.attitude.trace.plausible import outsized, plausible
from rig.procedures.attitude.trace.problem import Problem
from rig.procedures.attitude.trace.restarts import search_with_restarts
from rig.procedures.attitude.trace.result import Trace
from rig.procedures.attitude.trace.simpler import simplified
from rig.procedures.attitude.trace.unmodelled import UnmodelledSmooth
from rig.procedures.attitude.trace.wander import with_wander

SHOWN = 0.1
"""Share of a candidate in a sensor from which it is seen there."""
_SEARCH = 0.5
"""Part of the time until the first replication is left out, about."""


@dataclass(frozen=True)
class Search:
    """Settings of the search.

    Attributes:
        catalogue: effects to search.
        temperature: whether offset and sensitivity depend on the sensor's temperature in the declared model.
        unnamed: whether smooth terms without a cause may be added at the end.
        simulated: distributions of scores by chance, of this run and of parts of it.
    """

    catalogue: tuple[Effect, ...]
    temperature: bool
    unnamed: bool
    simulated: list[tuple[FloatArray, TableFamily]] = field(default_factory=list)

    def problem_of(self, data: AttitudeData) -> Problem:
        """`data` prepared for the search; raises as `trace` does."""
        return replace(make_problem(data, self.catalogue, temperature=self.temperature), simulated=self.simulated)

    def settle(self, problem: Problem, *, restarts: bool = True) -> tuple[AttitudeJudge, tuple[int, ...]]:
        """Search; then test the findings against the remaining random walk, until there is no change.

        A walk is estimated with the effects in the model and not before: a missing effect of temperature looks like
        one, and would be tested against itself. Terms without a cause come last.
        """
        begin = search_with_restarts if restarts else search_and_name
        judge, chosen = plausible(*supported(*begin(AttitudeJudge(problem))))
        simple = simplified(judge, chosen)
        if simple != chosen:
            judge, chosen = plausible(*supported(*search_and_name(judge, prune(judge, simple))))
        for _ in range(ROUNDS):
            walking = with_wander(judge.problem, chosen)
            if np.all((walking.wander > 0) == (judge.problem.wander > 0)):
                break
            judge = replace(judge, problem=walking)
            judge, chosen = plausible(*supported(*search_and_name(judge, prune(judge, chosen))))
        return search_and_name(judge.with_unnamed(), chosen) if self.unnamed else (judge, chosen)


def trace(
    data: AttitudeData,
    catalogue: Sequence[Effect] = CATALOGUE,
    *,
    temperature: bool = False,
    validate: bool = True,
    unnamed: bool = False,
) -> Trace:
    """Find effects missing in the declared attitude model.

    Args:
        data: a pitch-roll run; any number of sensors, judged together.
        catalogue: effects to search.
        temperature: whether offset and sensitivity depend on the sensor's temperature in the declared model.
        validate: repeat the search without each replication for the left-out error, which takes most of the time.
        unnamed: whether smooth terms without a cause may absorb the remainder, by the same rule.

    Raises:
        rig.fitter.linear.RankError: the points do not determine the declared model.
        FitError: the declared model has temperature, and none was recorded or it never changed.
    """
    search = Search((*catalogue, *UNNAMED) if unnamed else tuple(catalogue), temperature, unnamed)
    off, judge, found, not_kept = _settled(data, search)
    problem = judge.problem
    judge.forget()  # shapes without a name take as much memory
    named, every = _named(judge, found, outdo=not unnamed), found
    unmodelled, not_kept = named.unmodelled, (*not_kept, *named.outdone)
    unmodelled.forget()
    found = unmodelled.chosen
    cv = None
    if validate:
        cv = left_out(problem.scene.data, search, anything=bool(found), outdone=named.names)
    before, after = estimate(problem, ()), estimate(problem, found)
    inside = left_in(judge, found, problem.sensors, stated(before), lambda one: stated(estimate(problem, found, one)))
    taken_out = estimate(problem, found, inside) if any(inside) else after
    # beside all that was found: names that were left out hold the place of the shape that outdid them
    classes = {name: judge.rivals(every, name) for name in names_of(problem.candidates, found)}
    wrong = refusals(judge, found, classes, {name: fit.parameters.S_V for name, fit in problem.fits.items()})
    wrong = (*outsized(judge, found), *wrong)
    judge.forget()
    sensors = {
        sensor: sensor_trace(
            judge,
            data,
            off,
            not_kept,
            before,
            after,
            taken_out,
            classes,
            i,
            None if cv is None else cv[:, i],
            wrong,
            unmodelled,
            named.doubts,
        )
        for i, sensor in enumerate(problem.sensors)
    }
    chosen = tuple(problem.candidates[j] for j in after.chosen)
    explanations = explanations_of(classes, problem.candidates)
    others = alternatives(problem, after, classes)
    return Trace(
        sensors,
        problem.scene,
        chosen,
        after.gamma,
        taken_out.taken,
        len(data),
        tuple(np.flatnonzero(np.any(off != 0.0, axis=0)).tolist()),
        others,
        explanations=explanations,
    )


class Named(NamedTuple):
    """Findings that have a name.

    Attributes:
        unmodelled: the run beside it.
        doubts: reasons for doubt by name.
        outdone: names that one shape without a name outdoes.
    """

    unmodelled: UnmodelledSmooth
    doubts: dict[str, str]
    outdone: tuple[NotKept, ...] = ()

    @property
    def names(self) -> frozenset[str]:
        """Names that are outdone."""
        return frozenset(one.effect for one in self.outdone)


def _named(judge: AttitudeJudge, found: tuple[int, ...], *, outdo: bool) -> Named:
    """The findings without doubtful names that a shape without a name outdoes, if that is then said in each sensor.

    A name that stays is doubtful only if it was so before: that the shape has no name is no doubt about another cause.
    """
    every = UnmodelledSmooth(judge.problem, found)
    own, of_history = doubts_of(every), led_by_history(judge, found)
    doubts, outdone = own | of_history, outdone_in(every, own) if outdo else {}
    if not outdone:
        return Named(every, doubts)
    rest = replace(every.without(tuple(outdone)), outdoes=True)
    out = {(name, judge.candidates[j].sensor): place for name, place in outdone.items() for j in every.of(name)}
    seen = np.max([concerns(judge.problem, j) for name in outdone for j in every.of(name)], axis=0) > SHOWN
    if not all(left_without_a_name(judge.problem, rest, i) for i in np.flatnonzero(seen).tolist()):
        return Named(every, doubts)
    again = doubts_of(rest) | of_history
    kept = {name: again.get(name, why) for name, why in doubts.items() if name not in outdone}
    return Named(rest, kept, tuple(NotKept(*one, "shape", error=place) for one, place in out.items()))


def final_check(judge: AttitudeJudge, chosen: tuple[int, ...]) -> tuple[tuple[int, ...], tuple[NotKept, ...]]:
    """The kept ones of the `chosen` candidates, by the standard error of their sensors."""
    problem = judge.problem
    fitted = estimate(problem, chosen)
    same = [j for j in chosen if j not in fitted.told_apart]
    dependent = tuple(NotKept(name, sensor, "dependent") for name, sensor in groups_of(judge, same))

    def helps(chosen: tuple[int, ...], own: tuple[int, ...]) -> bool:
        fitted, without = estimate(problem, chosen), estimate(problem, tuple(j for j in chosen if j not in own))
        share = concerns(problem, own[0])
        pairs = zip(stated(fitted).tolist(), stated(without).tolist(), strict=True)
        ratio = [one / other if other > 0 else 1.0 for one, other in pairs]
        return float(np.dot(share, np.square(ratio))) < 1.0

    stay, idle = kept(judge, fitted.told_apart, helps, "the standard error of an observation")
    return stay, (*problem.left_out, *dependent, *idle)


def _settled(
    data: AttitudeData, search: Search
) -> tuple[FloatArray, AttitudeJudge, tuple[int, ...], tuple[NotKept, ...]]:
    """Search, and repeat with the readings reduced that stand alone beside the findings, until they are the same."""
    off = np.zeros((len(data.sensors), len(data)))
    for last in (False, False, True):
        outputs = {name: y - own for (name, y), own in zip(data.outputs.items(), off, strict=True)}
        judge, found = search.settle(search.problem_of(replace(data, outputs=outputs) if np.any(off) else data))
        found, not_kept = final_check(judge, found)
        again = alone(data, residual_of(judge.problem, estimate(judge.problem, found), data))
        if last or np.array_equal(again != 0.0, off != 0.0):
            break
        off = again
        judge.forget()  # otherwise two searches would take memory at once
    return off, judge, found, not_kept


def left_out(
    data: AttitudeData,
    search: Search,
    *,
    anything: bool = True,
    outdone: frozenset[str] = frozenset(),
) -> FloatArray | None:
    """(2, S) rms error of left-out replications, V, before and after; None if fewer than two can be left out.

    The search is repeated without the left-out replication, whose own offset is predicted as zero. Without findings in
    the whole run there is no repetition. Names that are `outdone` in the whole run are not used.
    """
    if data.replicates.size < 2:
        return None
    squares = np.zeros((2, len(data.sensors)))
    count = data.replicates.size
    for k in steps(range(count), lambda k: f"replication left out, {k + 1} of {count}", after=_SEARCH):
        inside = data.replicate_index != k
        rest, aside = data.take(np.flatnonzero(inside)), data.take(np.flatnonzero(~inside))
        try:
            problem = (search if anything else replace(search, catalogue=())).problem_of(rest)
        except FitError:
            return None
        squares += _squares_aside(problem, search, aside, outdone, anything=anything)
        del problem  # otherwise the next one would be built at the same time
    return np.asarray(np.sqrt(squares / len(data)))


def _squares_aside(
    problem: Problem, search: Search, aside: AttitudeData, outdone: frozenset[str], *, anything: bool
) -> FloatArray:
    """(2, S) sums of squared errors of data `aside`, before and after a search of the rest."""
    found: tuple[int, ...] = ()
    if anything:
        judge, found = search.settle(problem, restarts=False)
        problem = judge.problem
        found = tuple(j for j in found if problem.candidates[j].effect.name not in outdone)
    return np.stack([np.sum(residual_of(problem, estimate(problem, one), aside) ** 2, axis=1) for one in ((), found)])
