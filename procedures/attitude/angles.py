"""Sine and cosine of angles in degrees, exact at multiples of 90 deg.

In radians sin(180 deg) is 1.2e-16. A design with only such angles would have a column of rounding errors in place of
zeros, and a fit would use it as a measurement.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from rig.fitter.arrays import FloatArray


def sin_cos(angle_deg: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Sine and cosine of `angle_deg`, arrays of its shape."""
    angle = np.asarray(angle_deg, np.float64)
    quarter = np.rint(angle / 90.0)
    rest = np.radians(angle - 90.0 * quarter)
    s, c = np.sin(rest), np.cos(rest)
    turn = quarter.astype(np.int64) & 3
    swapped = (turn & 1).astype(np.bool_)
    return np.where(swapped, c, s) * (1.0 - (turn & 2)), np.where(swapped, s, c) * (1.0 - (turn + 1 & 2))
