"""The whole trace, from the residual to the effect."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

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
from rig.procedures.attitude.trace.findings import residual_of, sensor_trace
from rig.procedures.attitude.trace.judge import AttitudeJudge
from rig.procedures.attitude.trace.make_problem import make_problem
from rig.procedures.attitude.trace.noise import alone
from rig.procedures.attitude.trace.plausible import outsized, plausible
from rig.procedures.attitude.trace.problem import Problem
from rig.procedures.attitude.trace.restarts import search_with_restarts
from rig.procedures.attitude.trace.result import Trace
from rig.procedures.attitude.trace.simpler import simplified
from rig.procedures.attitude.trace.unmodelled import UnmodelledSmooth
from rig.procedures.attitude.trace.wander import with_wander

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
    cv = None
    if validate:
        judge.forget()  # the searches of parts, which take most memory, come while least is kept of the whole run
        cv = left_out(problem.scene.data, search, anything=bool(found))
    before, after = estimate(problem, ()), estimate(problem, found)
    inside = left_in(judge, found, problem.sensors, stated(before), lambda one: stated(estimate(problem, found, one)))
    taken_out = estimate(problem, found, inside) if any(inside) else after
    classes = {name: judge.rivals(found, name) for name in names_of(problem.candidates, found)}
    wrong = refusals(judge, found, classes, {name: fit.parameters.S_V for name, fit in problem.fits.items()})
    wrong = (*outsized(judge, found), *wrong)
    judge.forget()  # shapes without a name take as much memory
    unmodelled = UnmodelledSmooth(problem, found)
    doubts = doubts_of(unmodelled) | led_by_history(judge, found)
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
            doubts,
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
) -> FloatArray | None:
    """(2, S) rms error of left-out replications, V, before and after; None if fewer than two can be left out.

    The search is repeated without the left-out replication, whose own offset is predicted as zero. Without findings in
    the whole run there is no repetition.
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
        squares += _squares_aside(problem, search, aside, anything=anything)
        del problem  # otherwise the next one would be built at the same time
    return np.asarray(np.sqrt(squares / len(data)))


def _squares_aside(problem: Problem, search: Search, aside: AttitudeData, *, anything: bool) -> FloatArray:
    """(2, S) sums of squared errors of data `aside`, before and after a search of the rest."""
    found: tuple[int, ...] = ()
    if anything:
        judge, found = search.settle(problem, restarts=False)
        problem = judge.problem
    return np.stack([np.sum(residual_of(problem, estimate(problem, one), aside) ** 2, axis=1) for one in ((), found)])
