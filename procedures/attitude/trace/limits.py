"""How large each candidate's coefficient can plausibly be."""

from __future__ import annotations

import numpy as np

from fitter.arrays import FloatArray
from procedures.attitude.trace.problem import Problem


def limits(problem: Problem) -> FloatArray:
    """(J,) in the units of the terms; infinite where the catalogue knows no bound."""
    return np.array(
        [
            np.inf
            if c.effect.largest is None
            else c.effect.largest.of(problem.fits[c.sensor or problem.sensors[0]].parameters.S_V)
            for c in problem.candidates
        ],
        np.float64,
    )
