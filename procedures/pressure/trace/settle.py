"""Search, look at the noise beside what was found, and search again as that asks for, until both stand still.

Noise is looked for beside the effects and not before them: an effect of pressure not yet in the model is largest at
the highest pressures and would pass for noise that grows, a drift would pass for errors that are remembered, and what
stands out of a poor model need not stand out of a good one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fitter.arrays import FloatArray, IntArray
from fitter.trace.growing_noise import Noise
from fitter.trace.keep import kept
from fitter.trace.not_kept import NotKept
from fitter.trace.search import prune
from procedures.pressure.trace.agreement import named
from procedures.pressure.trace.estimate import error_of, estimate
from procedures.pressure.trace.judge import WholePlotJudge
from procedures.pressure.trace.memory import SEEMS, Memory, memories
from procedures.pressure.trace.null import Families, family_of
from procedures.pressure.trace.outliers import Outliers, outliers
from procedures.pressure.trace.problem import Problem
from procedures.pressure.trace.weights import noises, stands_out, weighted, weights_of

ROUNDS = 3
SAME = 0.05
"""Two autocorrelations closer than this make no difference."""


@dataclass(frozen=True, eq=False)
class Look:
    """The noise beside some effects, and the problem as it asks for.

    Attributes:
        problem: without the readings that stand out, weighted and whitened.
        noise: of each transducer, how it depends on pressure.
        grows: of each transducer, whether it does.
        memory: of each transducer, how readings' errors go with those before.
        aside: readings that stand out, of the whole run.

    """

    problem: Problem
    noise: tuple[Noise, ...]
    grows: tuple[bool, ...]
    memory: tuple[Memory, ...]
    aside: Outliers

    def asks_for_the_same(self, other: Look) -> bool:
        """Whether a search would be no different."""
        return (
            self.grows == other.grows
            and np.array_equal(self.aside.rows, other.aside.rows)
            and bool(np.allclose(self.problem.rho, other.problem.rho, atol=SAME))
        )


@dataclass(frozen=True, eq=False)
class Settled:
    """A search that stands still.

    Attributes:
        problem: as it was searched.
        families: of the search.
        chosen: candidates found.
        look: at the noise beside them.
        kept: (m,) rows of the whole run that the problem has.
        not_kept: candidates that stood out and were not kept, and why.

    """

    problem: Problem
    families: Families
    chosen: tuple[int, ...]
    look: Look
    kept: IntArray
    not_kept: tuple[NotKept, ...]


def settle(pressure_psia: FloatArray, whole: Problem, seed: int) -> Settled:
    """Find what belongs in the model.

    Args:
        pressure_psia: (n,) of the whole run.
        whole: the run as it is.
        seed: of the simulated null.

    """
    count = len(whole.sensors)
    none = Outliers(np.zeros(0, np.int64), *(np.zeros((count, 0)) for _ in range(3)))
    held = Look(whole, (), (False,) * count, (), none)
    families = family_of(whole, seed)
    chosen = named(WholePlotJudge(whole, families))
    for _ in range(ROUNDS):
        look = _look(pressure_psia, whole, chosen, held)
        if look.asks_for_the_same(held):
            break
        held, families = look, family_of(look.problem, seed)
        judge = WholePlotJudge(look.problem, families)
        chosen = named(judge, prune(judge, chosen))
    chosen, not_kept = stays(WholePlotJudge(held.problem, families), chosen)
    rows = np.setdiff1d(np.arange(whole.outputs.shape[1]), held.aside.rows)
    return Settled(held.problem, families, chosen, replace(look, aside=held.aside, grows=held.grows), rows, not_kept)


def stays(judge: WholePlotJudge, chosen: tuple[int, ...]) -> tuple[tuple[int, ...], tuple[NotKept, ...]]:
    """Those of the `chosen` candidates that stay, by the error of the stratum each is judged in."""
    problem = judge.problem

    def helps(chosen: tuple[int, ...], own: tuple[int, ...]) -> bool:
        if judge.candidates[own[0]].effect.of_noise:
            return True
        fitted, without = estimate(problem, chosen), estimate(problem, tuple(j for j in chosen if j not in own))
        level, sensor = problem.judged_at[own[0]], judge.candidates[own[0]].sensor
        concerned = [i for i, name in enumerate(problem.sensors) if sensor in (None, name)]
        return any(error_of(fitted, level, i) < error_of(without, level, i) for i in concerned)

    stay, idle = kept(judge, chosen, helps, "the error of its stratum")
    return stay, (*problem.left_out, *idle)


def _look(pressure_psia: FloatArray, whole: Problem, chosen: tuple[int, ...], held: Look) -> Look:
    """The noise beside the `chosen` candidates; what stands out is judged by the noise `held` so far."""
    every = replace(whole, weight=weights_of(held.noise, held.grows, pressure_psia))
    aside = outliers(every, chosen)
    kept = np.setdiff1d(np.arange(pressure_psia.size), aside.rows)
    plain, pressure = whole.take(kept), pressure_psia[kept]
    noise = noises(plain, chosen, pressure)
    grows = tuple(stands_out(one, len(noise)) for one in noise)
    problem, noise = weighted(plain, chosen, pressure, noise, grows)
    memory = memories(problem, chosen)
    rho = np.array([one.rho if one.p < SEEMS else 0.0 for one in memory])
    return Look(replace(problem, rho=rho), noise, grows, memory, aside)
