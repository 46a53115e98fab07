"""Pitch and roll from two axes, eqs. (83) to (95), in closed form.

Two outputs give gravity in the plane of the two sensitive axes; its length gives the remaining component up to a sign:

    g = M+ (v - b) + t n,   t = +- sqrt(1 - |M+ (v - b)|^2),

with n orthogonal to both axes. For x and y the sign distinguishes upright and inverted packages, for x and z the side
of the roll. Near t = 0 the two solutions meet: roll is near +-90 deg for x and y, near 0 or 180 deg for x and z.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rig.fitter.arrays import FloatArray
from rig.fitter.errors import FitError
from rig.procedures.attitude.infer.package import angles
from rig.procedures.attitude.infer.singular import normal

_ARC = np.linspace(-1.0, 1.0, 33)


def default_near(matrix: FloatArray) -> tuple[float, float]:
    """(pitch, roll) in rad of the usual attitude of two sensors: roll 0, or 90 deg for x and z.

    Raises:
        FitError: there is no usual one (y and z: their two solutions are pitch up and pitch down).
    """
    n = normal(matrix)
    for roll, component in ((0.0, -n[2]), (np.pi / 2, -n[1])):
        if abs(component) > 0.5:
            return 0.0, roll
    raise FitError("these two sensors cannot distinguish pitch up from pitch down: give an attitude near the true one")


def solve(matrix: FloatArray, y: FloatArray, near: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Gravity from two outputs.

    Args:
        matrix: (2, 3) V/g.
        y: (2, n) outputs minus offsets.
        near: (3, n) or (3, 1) gravity near the expected attitude.

    Returns:
        (3, n) gravity of unit length, (n,) its component t along n with sign, (n,) length of its part in the plane,
        which is above one if no attitude gives these outputs.
    """
    n = normal(matrix)
    flat = np.linalg.pinv(matrix) @ y
    length = np.sqrt(np.einsum("in,in->n", flat, flat))
    side = np.where(n @ near >= 0.0, 1.0, -1.0)
    t = side * np.sqrt(np.maximum(1.0 - length * length, 0.0))
    g = flat + t * n[:, None]
    return g / np.maximum(np.sqrt(np.einsum("in,in->n", g, g)), np.finfo(float).tiny), t, length


def radial_gains(matrix: FloatArray, g: FloatArray) -> FloatArray:
    """(2, n) change of the length in the plane per volt of each output."""
    n = normal(matrix)
    flat = g - n[:, None] * (n @ g)
    flat = flat / np.maximum(np.linalg.norm(flat, axis=0), np.finfo(float).tiny)
    return np.asarray(np.linalg.pinv(matrix).T @ flat)


def arc(
    matrix: FloatArray, g: FloatArray, t: FloatArray, reach: FloatArray, beyond: NDArray[np.bool_]
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Lowest and highest pitch and roll, in rad, of gravity with any component along n up to `reach`.

    Args:
        matrix: (2, 3).
        g: (3, n) inferred gravity.
        t: (n,) its component along n.
        reach: (n,) largest component along n, of either sign, consistent with the outputs.
        beyond: (n,) whether pitch is to be given beyond +-90 deg.
    """
    n = normal(matrix)
    flat = g - t * n[:, None]
    flat = flat / np.maximum(np.linalg.norm(flat, axis=0), np.finfo(float).tiny)
    part = np.clip(_ARC[:, None] * reach, -1.0, 1.0)
    along = np.sqrt(1.0 - part**2)[:, None, :] * flat + part[:, None, :] * n[:, None]
    pitch, roll = angles(np.moveaxis(along, 1, 0))
    pitch = np.where(beyond, np.where(pitch >= 0, 1.0, -1.0) * np.pi - pitch, pitch)
    middle = angles(flat)[1]
    turned = np.mod(roll - middle + np.pi, 2 * np.pi) - np.pi
    return pitch.min(0), pitch.max(0), middle + turned.min(0), middle + turned.max(0)
