"""Largest plausible coefficient of each candidate."""

from __future__ import annotations

import numpy as np

from fitter.arrays import FloatArray
from procedures.attitude.trace.problem import Problem


def limits(problem: Problem) -> FloatArray:
    """(J,) in the units of the terms; infinite if the catalogue has no bound."""
    return np.array(
        [
            np.inf
            if c.effect.largest is None
            else c.effect.largest.of(problem.fits[c.sensor or problem.sensors[0]].parameters.S_V)
            for c in problem.candidates
        ],
        np.float64,
    )
