"""Implausible sizes of a cause: the search continues without it, with a note."""

from __future__ import annotations

import numpy as np

from rig.fitter.trace.search import prune, search_and_name
from rig.fitter.trace.signs import SURE, Refused
from rig.procedures.attitude.trace.estimate import estimate
from rig.procedures.attitude.trace.judge import AttitudeJudge
from rig.procedures.attitude.trace.limits import limits
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
    most = limits(problem, chosen)
    stderr = np.sqrt(np.diag(fitted.covariance))
    over = np.maximum(np.abs(fitted.gamma) - SURE * stderr, 0.0) / most
    k = int(np.argmax(over))
    if over[k] <= 1.0:
        return None
    term = problem.candidates[chosen[k]]
    concerned = tuple(problem.sensors) if term.sensor is None else (term.sensor,)
    slope = problem.fits[concerned[0]].parameters.S_V
    name, value, error = term.term.name, float(fitted.gamma[k]), float(stderr[k])
    assert term.effect.largest is not None
    return Refused(
        effect=term.effect.name,
        instead_of="",
        sensors=concerned,
        quantity="size",
        value=value,
        stderr=error,
        size=term.effect.size({name: value}, slope, {name: error}, both=True),
        otherwise="",
        largest=term.effect.largest.text,
    )
