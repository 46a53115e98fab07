"""Variance functions without matrices: designs D1 and T of NASA/TP-1999-209835, sections 4.3 and 4.4.

Each is the variance of the calibrated output over that of one observation, for one replication.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from rig.fitter import RankError
from rig.fitter.arrays import FloatArray
from rig.procedures.attitude.angles import sin_cos

T6_VARIANCE = 2.0 / 3.0
"""Six-point tumble with roll, eq. (69): the same at every attitude."""
T4_VARIANCE = 3.0 / 4.0
"""Four-point tumble without roll, eq. (71): the same at every pitch."""


def d1_variance(pitch_deg: ArrayLike, pitch_max_deg: float, pitch_count: int, roll_count: int) -> FloatArray:
    """Design D1 with roll, eq. (66); of the shape of `pitch_deg`, and the same at every roll (Theorem IV).

    Args:
        pitch_deg: pitch of use of the sensor.
        pitch_max_deg: limit of the calibrated range, plus and minus.
        pitch_count: N, pitch angles uniform over that range, both ends included.
        roll_count: M, roll angles uniform over the circle, none repeated.

    Raises:
        RankError: the design does not determine the four coefficients.
    """
    n, m = pitch_count, roll_count
    _, c_2a = _sums(pitch_max_deg, n)
    if m < 3 or not _apart(n**2, c_2a**2):
        raise RankError(f"{n} pitch angles over +-{pitch_max_deg:g} deg at {m} rolls do not determine a sensor")
    _, cos = sin_cos(pitch_deg)
    return np.asarray(1.0 / (m * n) + 2.0 * (n + c_2a + (n - 3.0 * c_2a) * cos**2) / (m * (n**2 - c_2a**2)))


def d1_no_roll_variance(pitch_deg: ArrayLike, pitch_max_deg: float, pitch_count: int) -> FloatArray:
    """Design D1 without roll, eq. (67); of the shape of `pitch_deg`.

    The printed equation has C_2a in place of C_a, beside cos a and squared in the denominator; with it the value at
    zero pitch is half of the correct one (N = 33 over +-30 deg: 0.0688, not 0.0345).

    Args:
        pitch_deg: pitch of use of the sensor.
        pitch_max_deg: limit of the calibrated range, plus and minus.
        pitch_count: N, pitch angles uniform over that range, both ends included.

    Raises:
        RankError: the design does not determine the three coefficients.
    """
    n = pitch_count
    c_a, c_2a = _sums(pitch_max_deg, n)
    if not (_apart(n * (n + c_2a) / 2.0, c_a**2) and _apart(n, c_2a)):
        raise RankError(f"{n} pitch angles over +-{pitch_max_deg:g} deg do not determine a sensor without roll")
    sin, cos = sin_cos(pitch_deg)
    even = ((n + c_2a) / 2.0 - 2.0 * c_a * cos + n * cos**2) / (n * (n + c_2a) / 2.0 - c_a**2)
    return np.asarray(even + 2.0 * sin**2 / (n - c_2a))


def _sums(pitch_max_deg: float, count: int) -> tuple[float, float]:
    """C_a and C_2a of eqs. (165), (166): sums of cos a and cos 2a over the pitch angles.

    They are summed, because the quotient of sines in eq. (172) is 0/0 at whole turns.
    """
    pitch = np.linspace(-pitch_max_deg, pitch_max_deg, count)
    return float(np.sum(sin_cos(pitch)[1])), float(np.sum(sin_cos(2.0 * pitch)[1]))


def _apart(larger: float, smaller: float) -> bool:
    """Whether a difference exceeds the rounding errors of its terms."""
    return larger - smaller > 1e-12 * abs(larger)
