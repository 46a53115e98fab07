"""Agreement of all sensors about a common effect.

An error of the head or the package has one coefficient for all sensors. If only one sensor shows it, and the others
should but do not, the cause is in that sensor, however well the common column fits it.
"""

from __future__ import annotations

import numpy as np
from scipy import special

from rig.fitter.trace.search import names_of, prune, search_and_name
from rig.procedures.attitude.trace.judge import AttitudeJudge
from rig.procedures.attitude.trace.posed import engine_of, posed, units_of
from rig.procedures.attitude.trace.score import inverse

BY_CHANCE = 1e-4
"""Probability of the disagreement below which it is significant."""
MATTERS = 0.3
"""Minimum size of the disagreement relative to the common coefficient's contribution: columns are linear, and for an
effect a hundred times the error no two sensors agree to the last digit.
"""


def supported(judge: AttitudeJudge, chosen: tuple[int, ...]) -> tuple[AttitudeJudge, tuple[int, ...]]:
    """Search again without effects that sensors disagree on, until none is in the model."""
    while True:
        disagreed = frozenset(name for name in names_of(judge.candidates, chosen) if _disagreed(judge, chosen, name))
        if not disagreed:
            return judge, chosen
        judge = judge.without(disagreed)
        chosen = prune(judge, tuple(j for j in chosen if judge.candidates[j].effect.name not in disagreed))
        judge, chosen = search_and_name(judge, chosen)


def _disagreed(judge: AttitudeJudge, chosen: tuple[int, ...], name: str) -> bool:
    """Whether separate estimates from the sensors disagree about the terms of one effect."""
    problem = judge.problem
    unit = [j for j in chosen if problem.candidates[j].effect.name == name]
    if problem.candidates[unit[0]].sensor is not None or len(problem.sensors) == 1:
        return False
    engine, run = engine_of(problem, chosen), posed(problem)
    beside = engine.beside(units_of(problem, chosen))
    rest, own = (run.column[[j for j in chosen if (j in unit) == mine]] for mine in (False, True))
    weight = engine.problem.weight[beside.best] / beside.sigma2[beside.best]
    each = [engine.problem.told(np.where(run.of == i, weight, 0.0), rest, own) for i in range(len(problem.sensors))]
    columns, outputs = np.stack([one[0] for one in each]), np.stack([one[1] for one in each])
    length2 = np.stack([np.diag(one[2]) for one in each])
    apart, common = inverse(columns, length2), inverse(columns.sum(axis=0), length2.sum(axis=0))
    gain = float(outputs.sum(axis=0) @ common @ outputs.sum(axis=0))
    more = float(np.einsum("sj,sjk,sk->", outputs, apart, outputs)) - gain
    rank = round(float(np.einsum("sjk,skj->", apart, columns) - np.einsum("jk,kj->", common, columns.sum(axis=0))))
    return rank > 0 and more > MATTERS * gain and float(special.chdtrc(rank, more)) < BY_CHANCE
