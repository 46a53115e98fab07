"""Autocorrelation of readings' errors: test and estimate.

Slow changes within whole plots, such as settling or a lag, look like such errors. So autocorrelation is estimated with
the effects found, and these are tested against it again.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import special

from rig.fitter.arrays import FloatArray, IntArray
from rig.procedures.pressure.trace.estimate import coefficients_of, contributed
from rig.procedures.pressure.trace.problem import Problem

SEEMS = 0.05
"""Probability of such an autocorrelation by chance, below which readings are whitened by it."""
MOST = 0.98
"""Limit beyond which errors are constant throughout a whole plot, and belong to the whole plot."""


@dataclass(frozen=True)
class Memory:
    """First-order autocorrelation of the readings' errors within whole plots, in the executed order.

    Attributes:
        rho: correlation with the previous reading.
        p: probability of such a value by chance.
    """

    rho: float
    p: float


def memories(problem: Problem, chosen: tuple[int, ...]) -> tuple[Memory, ...]:
    """Autocorrelation of each transducer, with the `chosen` candidates: by restricted likelihood within whole plots."""
    between = tuple(int(j) for j in problem.within("whole-plot", chosen))
    known = coefficients_of(problem, chosen) if between else {}
    outputs = problem.outputs - contributed(problem, {j: known[j] for j in between})
    return tuple(_memory(problem, problem.within("subplot", chosen), y, i) for i, y in enumerate(outputs))


def _memory(problem: Problem, chosen: IntArray, y: FloatArray, i: int) -> Memory:
    own = problem.raw[i][:, chosen]
    both = np.column_stack([y, own[:, np.any(own != 0.0, axis=0)]])
    weight, ratio = problem.weight[i], float(problem.ratio[i])

    def deviance(rho: float) -> float:
        strata = problem.stratified(weight, ratio, rho)
        left = strata.leave(both, "subplot")
        r = np.linalg.qr(left[:, 1:], mode="reduced")[1] if left.shape[1] > 1 else np.eye(1)
        e = left[:, 0] - left[:, 1:] @ np.linalg.lstsq(left[:, 1:], left[:, 0], rcond=1e-9)[0]
        df = strata.df("subplot") - left.shape[1] + 1
        fitted = 2.0 * float(np.sum(np.log(np.maximum(np.abs(np.diag(r)), np.finfo(float).tiny))))
        return float(df * np.log(np.sum(e**2)) + strata.log_determinant + fitted)

    if problem.strata[i].df("subplot") - both.shape[1] <= 0:
        return Memory(0.0, 1.0)
    from scipy.optimize import minimize_scalar  # noqa: PLC0415 - 0.1 s, for those who look

    best = minimize_scalar(deviance, bounds=(0.0, MOST), method="bounded", options={"xatol": 0.01})
    fall = max(deviance(0.0) - float(best.fun), 0.0)
    return Memory(float(best.x), 0.5 * float(special.chdtrc(1, fall)))
