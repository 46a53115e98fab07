"""Search, estimate the noise with the findings, and search again accordingly, until both are stable.

Noise is estimated with the effects in the model and not before: a missing effect of pressure is largest at the highest
pressures and would look like growing noise, and outliers of a poor model need not be outliers of a good one. What the
search estimates with every candidate itself, errors of whole plots and their memory, is not estimated here.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rig.fitter.arrays import IntArray
from rig.fitter.trace.growing_noise import Noise
from rig.fitter.trace.keep import kept
from rig.fitter.trace.not_kept import NotKept
from rig.fitter.trace.search import prune
from rig.procedures.pressure.trace.agreement import named
from rig.procedures.pressure.trace.estimate import error_of, estimate
from rig.procedures.pressure.trace.judge import WholePlotJudge
from rig.procedures.pressure.trace.memory import Memory, memories
from rig.procedures.pressure.trace.outliers import Outliers, outliers
from rig.procedures.pressure.trace.problem import Problem
from rig.procedures.pressure.trace.weights import noises, stands_out, weighted, weights_of

ROUNDS = 3


@dataclass(frozen=True, eq=False)
class Look:
    """The noise with some effects, and the problem adapted to it.

    Attributes:
        problem: without outliers, weighted.
        noise: of each transducer, its dependence on pressure.
        grows: of each transducer, whether it grows.
        aside: outliers, of the whole run.
    """

    problem: Problem
    noise: tuple[Noise, ...]
    grows: tuple[bool, ...]
    aside: Outliers

    def asks_for_the_same(self, other: Look) -> bool:
        """Whether a search would give the same result."""
        return self.grows == other.grows and np.array_equal(self.aside.rows, other.aside.rows)


@dataclass(frozen=True, eq=False)
class Settled:
    """A stable search.

    Attributes:
        judge: of the search.
        chosen: candidates found.
        look: the noise with them.
        memory: of each transducer, autocorrelation of readings' errors.
        kept: (m,) rows of the whole run in the problem.
        not_kept: significant candidates that were not kept, with reasons.
    """

    judge: WholePlotJudge
    chosen: tuple[int, ...]
    look: Look
    memory: tuple[Memory, ...]
    kept: IntArray
    not_kept: tuple[NotKept, ...]


def settle(whole: Problem) -> Settled:
    """Find the terms that belong in the model of the original run."""
    count, n = whole.outputs.shape
    none = Outliers(np.zeros(0, np.int64), *(np.zeros((count, 0)) for _ in range(3)))
    held = Look(whole, (), (False,) * count, none)
    judge = WholePlotJudge.of(whole)
    chosen = named(judge)
    for _ in range(ROUNDS):
        look = _look(whole, chosen, held)
        if look.asks_for_the_same(held):
            break
        held, judge = look, WholePlotJudge.of(look.problem, judge)
        chosen = named(judge, prune(judge, chosen))
    chosen, not_kept = stays(judge, chosen)
    rows = np.setdiff1d(np.arange(n), held.aside.rows)
    look = replace(look, problem=judge.problem, aside=held.aside, grows=held.grows)
    return Settled(judge, chosen, look, memories(judge, chosen), rows, not_kept)


def stays(judge: WholePlotJudge, chosen: tuple[int, ...]) -> tuple[tuple[int, ...], tuple[NotKept, ...]]:
    """The kept ones of the `chosen` candidates, by the error of the stratum of each."""
    problem = judge.problem

    def helps(chosen: tuple[int, ...], own: tuple[int, ...]) -> bool:
        if judge.candidates[own[0]].effect.of_noise:
            return True
        fitted, without = estimate(judge, chosen), estimate(judge, tuple(j for j in chosen if j not in own))
        level, sensor = problem.judged_at[own[0]], judge.candidates[own[0]].sensor
        concerned = [i for i, name in enumerate(problem.sensors) if sensor in (None, name)]
        return any(error_of(fitted, level, i) < error_of(without, level, i) for i in concerned)

    stay, idle = kept(judge, chosen, helps, "the error of its stratum")
    return stay, (*problem.left_out, *idle)


def _look(whole: Problem, chosen: tuple[int, ...], held: Look) -> Look:
    """The noise beside the `chosen` candidates; outliers are judged with the noise `held` so far."""
    weight = weights_of(held.noise, held.grows, whole.pressure_psia)
    aside = outliers(replace(whole, weight=weight) if any(held.grows) else whole, chosen)
    plain = whole.take(np.setdiff1d(np.arange(whole.outputs.shape[1]), aside.rows))
    noise = noises(plain, chosen)
    grows = tuple(stands_out(one, len(noise)) for one in noise)
    problem, noise = weighted(plain, chosen, noise, grows)
    return Look(problem, noise, grows, aside)
