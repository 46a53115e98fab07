"""Lines and sentences about rising and falling series of a run that differ by more than scatter."""

from __future__ import annotations

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.budget import TypeA
from rig.fitter.sums_of_squares import FTest

SERIES = "rising and falling series of the run"
"""Source of a line."""
EITHER_SIDE = (
    "each reading is on one of two sides, so half of the difference between them is the standard uncertainty of "
    "reversibility. Where it dominates, the coverage factor is smaller than Student's t: U is half of the difference "
    "plus the one-sided limit of the rest"
)


def line_of(name: str, sides: FloatArray, variance: FloatArray) -> TypeA:
    """The line for (2, m) results of rising and of falling series, less the results.

    A reading is on one side or the other: the deviation has two values, so its size is its standard uncertainty. That
    is more than the rectangular distribution of ISO 376 and EURAMET cg-4, which is for readings of any history.

    Args:
        name: of the sensor.
        sides: (2, m).
        variance: (m,) of half of the difference, by the run.
    """
    size = np.max(np.abs(sides), axis=0) * np.where(sides[0] < sides[1], -1.0, 1.0)
    covariance = np.outer(size, size) + np.diag(np.where(size == 0.0, 0.0, variance))
    return TypeA(covariance, np.inf, f"reversibility of {name}", SERIES, "B", deviation=size)


def in_words(name: str, test: FTest) -> str:
    """A sentence about the difference and its test."""
    return (
        f"{name}: rising and falling series differ by more than scatter (F = {test.value:.3g} with {test.df_above} and "
        f"{test.df_below} degrees of freedom, p = {test.p:.2g}): results are half-way between, and reversibility has a "
        f"line, half of the difference as standard uncertainty"
    )
