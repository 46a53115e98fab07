"""Singular attitudes of a package: the loci of figures 9, 11 and 12."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from rig.fitter.arrays import FloatArray
from rig.fitter.errors import FitError
from rig.procedures.attitude.angles import sin_cos
from rig.procedures.attitude.infer.calibration import AttitudeCalibration
from rig.procedures.attitude.infer.package import directions

FEWEST_SD = 5.0
"""Minimum distance of an attitude from a singularity, in standard deviations, for first-order errors."""


def normal(matrix: FloatArray) -> FloatArray:
    """(3,) unit vector orthogonal to the axes of two sensors, (2, 3) `matrix`.

    Raises:
        FitError: they are parallel.
    """
    across = np.cross(matrix[0], matrix[1])
    length = float(np.linalg.norm(across))
    if length < 1e-6 * float(np.linalg.norm(matrix[0]) * np.linalg.norm(matrix[1])):
        raise FitError("the two sensors are along one axis: measured roll is needed")
    return np.asarray(across / length)


def singularity(calibration: AttitudeCalibration, pitch_deg: ArrayLike, roll_deg: ArrayLike) -> FloatArray:
    """Distance of an attitude from a singular one, where pitch and roll are not both determined; zero on the loci of
    figures 9, 11, 12.

    Two sensors (eqs. 86, 94): the determinant of the Jacobian by pitch and roll, over that of the most favourable
    attitude. It is cos(pitch) times the component of gravity along the axis orthogonal to both sensors, and changes its
    sign across each locus. Three sensors: the square root of the determinant of eq. (102)'s moment matrix, of sensors
    of unit sensitivity; never negative.

    Args:
        calibration: of two or three sensors.
        pitch_deg: of any shape.
        roll_deg: of the same shape, or one that broadcasts to it.
    """
    matrix = calibration.matrix / np.linalg.norm(calibration.matrix, axis=1)[:, None]
    (sin_a, cos_a), (sin_r, cos_r) = sin_cos(pitch_deg), sin_cos(roll_deg)
    g = np.stack(np.broadcast_arrays(sin_a, -sin_r * cos_a, -cos_r * cos_a))
    if len(matrix) == 2:
        return np.asarray(np.broadcast_to(cos_a, g.shape[1:]) * np.tensordot(normal(matrix), g, 1))
    if len(matrix) < 2:
        raise FitError("one sensor never determines pitch and roll")
    turns, c = directions(g.reshape(3, -1))
    f_up, f_along = matrix @ turns[:, 0], matrix @ turns[:, 1]
    squares = (f_up**2).sum(0) * (f_along**2).sum(0) - (f_up * f_along).sum(0) ** 2
    return np.asarray((c * np.sqrt(np.maximum(squares, 0.0))).reshape(g.shape[1:]))
