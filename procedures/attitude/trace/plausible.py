"""Implausible sizes of a cause: the search continues without it, with a note."""

from __future__ import annotations

import numpy as np

from rig.fitter import ties
from rig.fitter.trace.search import prune, search_and_name
from rig.fitter.trace.signs import SURE, Impossible, Refused
from rig.procedures.attitude.trace.estimate import estimate
from rig.procedures.attitude.trace.judge import AttitudeJudge
from rig.procedures.attitude.trace.problem import Problem


def plausible(judge: AttitudeJudge, chosen: tuple[int, ...]) -> tuple[AttitudeJudge, tuple[int, ...]]:
    """Search again without effects of an impossible size, the worst first: others may become smaller without it."""
    while chosen:
        worst = _worst(judge.problem, chosen)
        if worst is None:
            break
        judge = judge.too_large(worst)
        out = judge.closed
        rest = tuple(j for j in chosen if (judge.candidates[j].effect.name, judge.candidates[j].sensor) not in out)
        judge, chosen = search_and_name(judge, prune(judge, rest))
    return judge, chosen


def _worst(problem: Problem, chosen: tuple[int, ...]) -> Refused | None:
    """The effect that most exceeds its largest plausible size, significantly."""
    fitted = estimate(problem, chosen)
    stderr = np.sqrt(np.diag(fitted.covariance))
    over = np.maximum(np.abs(fitted.gamma) - SURE * stderr, 0.0) / problem.most[list(chosen)]
    k = ties.highest(over)
    if over[k] <= 1.0:
        return None
    return _refused(problem, Impossible(chosen[k], float(fitted.gamma[k]), float(stderr[k])))


def outsized(judge: AttitudeJudge, chosen: tuple[int, ...]) -> tuple[Refused, ...]:
    """Causes that the data suggest beside the findings, refused for their size, once per sensor or set of sensors.

    The search never tries them. A cause that is found with another term is none of them.
    """
    known = {(one.effect, one.sensors): one for one in judge.oversized}
    named = {judge.candidates[j].effect.name for j in chosen}
    for found in judge.outsized(chosen):
        one = _refused(judge.problem, found)
        if one.effect not in named:
            known.setdefault((one.effect, one.sensors), one)
    return tuple(known.values())


def _refused(problem: Problem, found: Impossible) -> Refused:
    term = problem.candidates[found.candidate]
    concerned = tuple(problem.sensors) if term.sensor is None else (term.sensor,)
    slope, name = problem.fits[concerned[0]].parameters.S_V, term.term.name
    assert term.effect.largest is not None
    return Refused(
        effect=term.effect.name,
        instead_of="",
        sensors=concerned,
        quantity="size",
        value=found.value,
        stderr=found.stderr,
        size=term.effect.size({name: found.value}, slope, {name: found.stderr}, both=True),
        otherwise="",
        largest=term.effect.largest.text,
    )
