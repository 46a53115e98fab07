"""Search, estimate the noise with the findings, and search again accordingly, until both are stable.

Noise is estimated with the effects in the model and not before: a missing effect of pressure is largest at the highest
pressures and would look like growing noise. What the search estimates with every candidate itself, errors of whole
plots, their memory and readings that stand alone, is not estimated here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.trace.engine.left import left_of
from rig.fitter.trace.growing_noise import Growth, Noise, growth_of
from rig.fitter.trace.keep import kept
from rig.fitter.trace.not_kept import NotKept
from rig.fitter.trace.search import prune
from rig.procedures.pressure.trace.agreement import named
from rig.procedures.pressure.trace.estimate import error_of, estimate
from rig.procedures.pressure.trace.judge import WholePlotJudge
from rig.procedures.pressure.trace.problem import Problem

ROUNDS = 3


@dataclass(frozen=True, eq=False)
class Settled:
    """A stable search.

    Attributes:
        judge: of the search.
        chosen: candidates found.
        noise: of each transducer, where its scatter grows with the pressure; None elsewhere.
        p: of each, by chance, over all.
        not_kept: significant candidates that were not kept, with reasons.
    """

    judge: WholePlotJudge
    chosen: tuple[int, ...]
    noise: tuple[Noise | None, ...]
    p: tuple[float, ...]
    not_kept: tuple[NotKept, ...]


def settle(whole: Problem) -> Settled:
    """Find the terms that belong in the model of a run."""
    judge, grows = WholePlotJudge.of(whole), (False,) * len(whole.sensors)
    chosen = named(judge)
    for _ in range(ROUNDS):
        found = _growth(judge, chosen)
        if not any(found) and not any(grows):
            break
        settled, grows = grows == tuple(map(bool, found)), tuple(map(bool, found))
        weight = np.array([_weight(one, whole.pressure_psia) for one in found])
        judge = WholePlotJudge.of(replace(whole, weight=weight), judge)
        again = named(judge, prune(judge, chosen))
        settled, chosen = settled and set(again) == set(chosen), again
        if settled:
            break
    chosen, not_kept = stays(judge, chosen)
    found = _growth(judge, chosen)
    noise = tuple(None if one is None or not grown else over(one) for one, grown in zip(found, grows, strict=True))
    return Settled(judge, chosen, noise, tuple(1.0 if one is None else one.p for one in found), not_kept)


def _growth(judge: WholePlotJudge, chosen: Sequence[int]) -> list[Growth | None]:
    """Dependence of each transducer's scatter on the pressure, with the `chosen` candidates."""
    run, out = judge.problem, list[Growth | None]()
    for i in range(len(run.sensors)):
        left, share, _ = left_of(judge.table(i)[0], judge.in_table(i, chosen))
        found = growth_of(left, share, {"pressure": run.pressure_psia}, sensors=len(run.sensors))
        out.append(found if isinstance(found, Growth) and found.noise.per_unit > 0.0 else None)
    return out


def _weight(growth: Growth | None, pressure_psia: FloatArray) -> FloatArray:
    """(n,) weights of readings, mean one."""
    weight = np.ones_like(pressure_psia) if growth is None else growth.sd(pressure_psia) ** -2.0
    return np.asarray(weight / weight.mean())


def over(growth: Growth) -> Noise:
    """The same over the pressure, psia."""
    (low, high), noise = growth.span, growth.noise
    size = noise.per_unit / (high - low)
    error = noise.stderr[0], noise.stderr[1] / (high - low)
    if noise.middle is not None:
        return replace(noise, per_unit=size, stderr=error, middle=low + noise.middle * (high - low))
    return replace(noise, at_zero=noise.at_zero - size * low, per_unit=size, stderr=error)


def stays(judge: WholePlotJudge, chosen: tuple[int, ...]) -> tuple[tuple[int, ...], tuple[NotKept, ...]]:
    """The kept ones of the `chosen` candidates, by the error of the stratum of each."""
    problem = judge.problem

    def helps(chosen: tuple[int, ...], own: tuple[int, ...]) -> bool:
        if judge.candidates[own[0]].effect.of_noise:
            return True
        fitted, without = (estimate(judge, some, chosen) for some in (chosen, tuple(j for j in chosen if j not in own)))
        level, sensor = problem.judged_at[own[0]], judge.candidates[own[0]].sensor
        concerned = [i for i, name in enumerate(problem.sensors) if sensor in (None, name)]
        return any(error_of(fitted, level, i) < error_of(without, level, i) for i in concerned)

    stay, idle = kept(judge, chosen, helps, "the error of its stratum")
    return stay, (*problem.left_out, *idle)
