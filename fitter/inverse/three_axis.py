"""Attitude of a three-axis package, fast: eqs. (99) to (102) without trigonometry before the last two arctangents.

The weighted least-squares attitude makes (v - b - M g)' W (v - b - M g) least among unit vectors g. With
g0 = M^-1 (v - b) and the principal axes of M'WM as coordinates it is

    u_i = u0_i / (1 + l p_i),   sum of u_i^2 = 1,

one unknown l that is zero where the outputs make exactly 1 g; p are the principal variances. Newton's method from
l = 0 doubles the digits at each step: one is within the square of the outputs' relative error, two within its fourth.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fitter.arrays import FloatArray

CHUNK = 4096
"""Readings that are worked on together: few enough for the cache nearest to the processor."""


@dataclass(frozen=True, eq=False)
class ThreeAxis:
    """What can be prepared before readings come.

    Attributes:
        offsets_V: (S,), three sensors or more.
        to_principal: (3, S) from outputs less offsets to principal axes.
        to_package: (3, 3) from principal to package axes.
        variance: (3,) principal variances, the greatest being one.

    """

    offsets_V: FloatArray
    to_principal: FloatArray
    to_package: FloatArray
    variance: FloatArray

    @staticmethod
    def of(offsets_V: FloatArray, matrix: FloatArray, sigma_V: FloatArray) -> ThreeAxis:
        """Prepare for outputs = offsets + matrix @ g_M.

        Args:
            offsets_V: (S,).
            matrix: (S, 3) V/g.
            sigma_V: (S,) standard deviation of a reading of each sensor.

        Raises:
            ValueError: the sensitive axes lie in a plane: two axes' worth of information.

        """
        if len(matrix) < 3:
            raise ValueError(f"three sensors are expected, found {len(matrix)}")
        if np.linalg.cond(matrix / np.linalg.norm(matrix, axis=1)[:, None]) > 1e6:
            raise ValueError("the sensitive axes of the three sensors lie in a plane")
        left, root, axes = np.linalg.svd(matrix / sigma_V[:, None], full_matrices=False)
        variance = root**-2.0
        return ThreeAxis(offsets_V, left.T / root[:, None] / sigma_V, axes.T, variance / variance.max())

    def gravity(self, outputs_V: FloatArray, steps: int = 2) -> FloatArray:
        """(3, n) gravity in package axes of (n, S) outputs, unit length to the order of `steps`."""
        u = self.to_principal @ (outputs_V.T - self.offsets_V[:, None])
        p0, p1, p2 = self.variance
        s0, s1, s2 = u[0] * u[0], u[1] * u[1], u[2] * u[2]
        excess = s0 + s1 + s2 - 1.0
        multiplier = excess / (2.0 * (p0 * s0 + p1 * s1 + p2 * s2))
        for _ in range(steps - 1):
            f0, f1, f2 = 1.0 / (1.0 + multiplier * p0), 1.0 / (1.0 + multiplier * p1), 1.0 / (1.0 + multiplier * p2)
            t0, t1, t2 = s0 * f0 * f0, s1 * f1 * f1, s2 * f2 * f2
            multiplier += (t0 + t1 + t2 - 1.0) / (2.0 * (p0 * t0 * f0 + p1 * t1 * f1 + p2 * t2 * f2))
        for i in range(3):
            u[i] /= 1.0 + multiplier * self.variance[i]
        return np.asarray(self.to_package @ u)

    def angles_deg(self, outputs_V: ArrayLike, steps: int = 1) -> tuple[FloatArray, FloatArray]:
        """Pitch, within +-90 deg, and roll of (n, S) outputs in volts; (n,) each.

        Args:
            outputs_V: (n, S), sensors in the order of the matrix.
            steps: of Newton's method. One is within 1e-7 rad of least squares for sensors of 1e-4 g and better, two
                within 1e-9.

        """
        outputs = np.asarray(outputs_V, np.float64)
        sensors = self.offsets_V.size
        if outputs.ndim != 2 or outputs.shape[1] != sensors:
            raise ValueError(f"outputs are expected as (n, {sensors}), found shape {outputs.shape}")
        pitch, roll = np.empty(len(outputs)), np.empty(len(outputs))
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            for i in range(0, len(outputs), CHUNK):
                part = slice(i, i + CHUNK)
                x, y, z = self.gravity(outputs[part], steps)
                np.arctan2(x, np.sqrt(y * y + z * z), out=pitch[part])
                np.arctan2(-y, -z, out=roll[part])
                pitch[part] *= 180.0 / np.pi
                roll[part] *= 180.0 / np.pi
        return pitch, roll
