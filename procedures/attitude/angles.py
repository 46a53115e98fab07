"""Sine and cosine of angles in degrees, exact at multiples of 90 deg.

In radians sin(180 deg) comes out as 1.2e-16. A design that only visits such angles would leave a column of rounding
errors where there is nothing, and a fit would take it for a measurement.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from fitter.arrays import FloatArray


def sin_cos(angle_deg: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Sine and cosine of `angle_deg`, each of its shape."""
    angle = np.asarray(angle_deg, np.float64)
    quarter = np.rint(angle / 90.0)
    rest = np.radians(angle - 90.0 * quarter)
    s, c = np.sin(rest), np.cos(rest)
    turn = quarter.astype(np.int64) & 3
    swapped = (turn & 1).astype(np.bool_)
    return np.where(swapped, c, s) * (1.0 - (turn & 2)), np.where(swapped, s, c) * (1.0 - (turn + 1 & 2))
