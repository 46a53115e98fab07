"""Coverage factors of Student's t, for one and for many degrees of freedom."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy import special

from fitter.arrays import FloatArray
from fitter.errors import FitError

NORMAL_FROM = 1e5
"""Degrees of freedom above which the normal distribution counts, as in GTC."""


def coverage_factor(probability: float, df: ArrayLike) -> FloatArray:
    """Coverage factor k for a coverage probability (JCGM 100, G.3), in the shape of `df`.

    Degrees of freedom are not rounded to whole numbers.

    Raises:
        FitError: the probability is not between 0 and 1.

    """
    if not 0.0 < probability < 1.0:
        raise FitError(f"a coverage probability of {probability:g}: it must be between 0 and 1")
    upper, numbers = 0.5 * (1.0 + probability), np.asarray(df, dtype=np.float64)
    t = special.stdtrit(np.minimum(numbers, NORMAL_FROM), upper)
    return np.asarray(np.where(numbers > NORMAL_FROM, special.ndtri(upper), t))
