"""The design of the low-range paper: 20 whole plots of 11 readings, 10 coefficients."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

NAMES = ("1", "p", "t1", "t2", "pp", "t11", "t22", "pt1", "pt2", "t12")
PRESSURES = [0.01, 0.12, 0.50, 0.79, 1.00, 2.50, 4.00, 5.00, 0.01, 2.50, 5.00]
A = np.sqrt(2.0)
CORNERS = [(-1, -1), (1, -1), (-1, 1), (1, 1)]
TEMPERATURES = np.array([*CORNERS, *CORNERS, *[(-A, 0), (A, 0)] * 2, (0, -A), (0, A), *[(0, 0)] * 6])
WHOLE_PLOT = np.repeat(np.arange(20), 11)


def columns() -> NDArray[np.float64]:
    """(220, 10) in order of `NAMES`."""
    p, (t1, t2) = np.tile(PRESSURES, 20), TEMPERATURES[WHOLE_PLOT].T
    return np.column_stack([np.ones(220), p, t1, t2, p * p, t1 * t1, t2 * t2, p * t1, p * t2, t1 * t2])
