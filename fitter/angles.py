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
    quarter = np.round(angle / 90.0)
    rest = np.radians(angle - 90.0 * quarter)
    s, c = np.sin(rest), np.cos(rest)
    turn = np.mod(quarter, 4.0).astype(np.int64)
    return np.choose(turn, (s, c, -s, -c)), np.choose(turn, (c, -s, -c, s))
