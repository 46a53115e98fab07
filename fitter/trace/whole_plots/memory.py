"""Errors of readings that remember the reading before: whether they do, and how much.

Whatever moves slowly within whole plots, a settling or a lag, is like such errors; they are looked for beside the
effects found, and what was found is judged against them again.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import special
from scipy.optimize import minimize_scalar

from fitter.trace.whole_plots.problem import Problem

SEEMS = 0.05
"""Probability of so much memory by chance, below which readings are whitened by it."""
MOST = 0.98
"""Beyond this errors stay what they were throughout a whole plot, and are the whole plot's."""


@dataclass(frozen=True)
class Memory:
    """First-order autocorrelation of the readings' errors within whole plots, in the executed order.

    Attributes:
        rho: correlation with the reading before.
        p: probability of so clear a one where there is none.

    """

    rho: float
    p: float


def memories(problem: Problem, chosen: tuple[int, ...]) -> tuple[Memory, ...]:
    """Of each transducer, beside the `chosen` candidates: restricted likelihood of what is left within whole plots."""
    return tuple(_memory(problem, chosen, i) for i in range(len(problem.sensors)))


def _memory(problem: Problem, chosen: tuple[int, ...], i: int) -> Memory:
    beside, y = problem.raw[i][:, list(chosen)], problem.outputs[i][:, None]
    weight, ratio = problem.weight[i], float(problem.ratio[i])

    def deviance(rho: float) -> float:
        strata = problem.stratified(weight, ratio, rho, beside)
        left = strata.leave(y, "subplot")
        return strata.df("subplot") * float(np.log(np.sum(left**2))) + strata.log_determinant

    if problem.stratified(weight, ratio, 0.0, beside).df("subplot") <= 1:
        return Memory(0.0, 1.0)
    best = minimize_scalar(deviance, bounds=(0.0, MOST), method="bounded", options={"xatol": 0.01})
    fall = max(deviance(0.0) - float(best.fun), 0.0)
    return Memory(float(best.x), 0.5 * float(special.chdtrc(1, fall)))
