"""Agreement of all sensors about a common effect.

An error of the head or the package has one coefficient for all sensors. If only one sensor shows it, and the others
should but do not, the cause is in that sensor, however well the common column fits it.
"""

from __future__ import annotations

import numpy as np
from scipy import special

from rig.fitter.arrays import FloatArray
from rig.fitter.trace.search import names_of, prune, search_and_name
from rig.procedures.attitude.trace.judge import AttitudeJudge
from rig.procedures.attitude.trace.levels import Level
from rig.procedures.attitude.trace.problem import Problem
from rig.procedures.attitude.trace.score import beside, errors, inverse

BY_CHANCE = 1e-4
"""Probability of the disagreement below which it is significant."""
MATTERS = 0.3
"""Minimum size of the disagreement relative to the common coefficient's contribution: columns are linear, and for an
effect a hundred times the error no two sensors agree to the last digit.
"""


def supported(judge: AttitudeJudge, chosen: tuple[int, ...]) -> tuple[AttitudeJudge, tuple[int, ...]]:
    """Search again without effects that sensors disagree on, until none is in the model."""
    while True:
        disagreed = frozenset(
            name for name in names_of(judge.candidates, chosen) if _disagreed(judge.problem, chosen, name)
        )
        if not disagreed:
            return judge, chosen
        judge = judge.without(disagreed)
        chosen = prune(judge, tuple(j for j in chosen if judge.candidates[j].effect.name not in disagreed))
        judge, chosen = search_and_name(judge, chosen)


def _disagreed(problem: Problem, chosen: tuple[int, ...], name: str) -> bool:
    """Whether separate estimates from the sensors disagree about the terms of one effect."""
    unit = np.array([j for j in chosen if problem.candidates[j].effect.name == name], np.int64)
    if problem.candidates[unit[0]].sensor is not None or len(problem.sensors) == 1:
        return False
    level = problem.judged_at[unit[0]]
    sigma = _errors(problem, level, chosen)
    left = beside(problem, level, [j for j in chosen if j not in unit], unit, sigma)
    length2 = problem.length[:, unit] ** 2 / sigma[:, None] ** 2
    each, columns, outputs = inverse(left.columns, length2), left.columns.sum(axis=0), left.outputs.sum(axis=0)
    common = inverse(columns, length2.sum(axis=0))
    gain = float(outputs @ common @ outputs)
    apart = float(np.einsum("sj,sjk,sk->", left.outputs, each, left.outputs)) - gain
    rank = round(float(np.einsum("sjk,skj->", each, left.columns) - np.einsum("jk,kj->", common, columns)))
    return rank > 0 and apart > MATTERS * gain and float(special.chdtrc(rank, apart)) < BY_CHANCE


def _errors(problem: Problem, level: Level, chosen: tuple[int, ...]) -> FloatArray:
    """(S,) standard errors, including remaining lack of fit."""
    sigma = errors(problem, chosen)
    lof = problem.levels.n_points - problem.levels.declared.shape[1] - len(chosen)
    if level == "points" or lof <= 0 or problem.levels.df("points") <= 0:
        return sigma
    nothing = np.zeros(0, np.int64)
    between, within = (beside(problem, at, chosen, nothing, sigma).square for at in ("replications", "points"))
    return np.asarray(sigma * np.sqrt(np.maximum((between - within) / lof, 1.0)))
