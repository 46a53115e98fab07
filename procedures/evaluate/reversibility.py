"""Lines and sentences about rising and falling series of a run that differ by more than scatter."""

from __future__ import annotations

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.budget import TypeA
from rig.fitter.sums_of_squares import FTest

SERIES = "rising less falling series of the run (ISO 376; EURAMET cg-4)"
"""Source of a line: rectangular, half of the difference wide on each side."""


def line_of(name: str, differs: FloatArray) -> TypeA:
    """The line for (m,) results of rising series less those of falling ones.

    The difference is the full width of a rectangular distribution, as ISO 376 has it.
    """
    return TypeA(np.outer(differs, differs) / 12.0, np.inf, f"reversibility of {name}", SERIES, "B")


def in_words(name: str, test: FTest) -> str:
    """A sentence about the difference and its test."""
    return (
        f"{name}: rising and falling series differ by more than scatter (F = {test.value:.3g} with {test.df_above} and "
        f"{test.df_below} degrees of freedom, p = {test.p:.2g}): results are half-way between, and reversibility has a "
        f"line, the difference as the full width of a rectangular distribution"
    )
