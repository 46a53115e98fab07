"""Largest plausible coefficient of candidates."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.procedures.attitude.trace.problem import Problem


def limits(problem: Problem, picked: Sequence[int]) -> FloatArray:
    """(q,) of the candidates `picked`, in the units of their terms; infinite if the catalogue has no bound."""
    candidates = [problem.candidates[j] for j in picked]
    return np.array(
        [
            np.inf
            if c.effect.largest is None
            else c.effect.largest.of(problem.fits[c.sensor or problem.sensors[0]].parameters.S_V)
            for c in candidates
        ],
        np.float64,
    )
