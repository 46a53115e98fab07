"""Autocorrelation of readings' errors beside the effects found: a component of their errors, with the others as likely
as they are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import special

from rig.fitter.least import least
from rig.fitter.trace.engine.likelihood import Grid
from rig.procedures.pressure.trace.judge import WholePlotJudge

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


def memories(judge: WholePlotJudge, chosen: Sequence[int]) -> tuple[Memory, ...]:
    """Autocorrelation of each transducer, with the `chosen` candidates, by restricted likelihood."""
    return tuple(_memory(judge, chosen, i) for i in range(len(judge.problem.sensors)))


def _memory(judge: WholePlotJudge, chosen: Sequence[int], i: int) -> Memory:
    problem, errors = judge.problem, judge.white(chosen).errors[i]
    own = problem.raw[i][:, list(chosen)]
    model = np.hstack([problem.model, own[:, np.any(own != 0.0, axis=0)]]) / errors.sd[:, None]
    y, (offset, slope, _) = problem.outputs[i] / errors.sd, errors.noise.grid[0].tolist()

    def deviance(rho: float) -> float:
        noise = replace(errors.noise, grid=np.array([[offset, slope, rho]]))
        return -2.0 * float(Grid.of(noise, y, model).beside().reml[0]) - float(noise.prices[0])

    best = least(deviance, 0.0, MOST, 0.01)
    fall = max(deviance(0.0) - best.value, 0.0)
    return Memory(best.x, 0.5 * float(special.chdtrc(1, fall)))
