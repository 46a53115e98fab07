"""Attitude of a three-axis package, fast: eqs. (99) to (102) without trigonometry before the last two arctangents.

The weighted least-squares attitude makes (v - b - M g)' W (v - b - M g) least among unit vectors g. With
g0 = M^-1 (v - b) and the principal axes of M'WM as coordinates it is

    u_i = u0_i / (1 + l p_i),   sum of u_i^2 = 1,

one unknown l that is zero where the outputs make exactly 1 g; p are the principal variances. In powers of the excess
e = |u0|^2 - 1, with P = sum p u0^2 and Q = sum p^2 u0^2,

    l = (e / 2P) (1 + (3Q / 2P) (e / 2P)) + ...,

which is the first correction, within the cube of the outputs' relative error; each that follows is a step of Newton's
method and doubles the digits.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from fitter.arrays import FloatArray
from fitter.errors import FitError

CHUNK = 8192
"""Number of readings processed together, by the size of the nearest cache."""


@dataclass(frozen=True, eq=False)
class ThreeAxis:
    """Values prepared before readings.

    Attributes:
        offsets_V: (S,), three sensors or more.
        to_principal: (3, S) from outputs minus offsets to principal axes.
        to_package: (3, 3) from principal to package axes.
        variance: (3,) principal variances; the largest is one.
    """

    offsets_V: FloatArray
    to_principal: FloatArray
    to_package: FloatArray
    variance: FloatArray

    @cached_property
    def _shift(self) -> FloatArray:
        return np.asarray(self.to_principal @ self.offsets_V)[:, None]

    @cached_property
    def _variance_squared(self) -> FloatArray:
        return np.asarray(self.variance**2)

    @staticmethod
    def of(offsets_V: FloatArray, matrix: FloatArray, sigma_V: FloatArray) -> ThreeAxis:
        """Prepare for outputs = offsets + matrix @ g_M.

        Args:
            offsets_V: (S,).
            matrix: (S, 3) V/g.
            sigma_V: (S,) standard deviation of a reading of each sensor.

        Raises:
            ValueError: the sensitive axes are in one plane, so they are equivalent to two axes.
        """
        if len(matrix) < 3:
            raise ValueError(f"three sensors are expected, found {len(matrix)}")
        if np.linalg.cond(matrix / np.linalg.norm(matrix, axis=1)[:, None]) > 1e6:
            raise FitError("the sensitive axes of the three sensors lie in a plane")
        left, root, axes = np.linalg.svd(matrix / sigma_V[:, None], full_matrices=False)
        variance = root**-2.0
        return ThreeAxis(offsets_V, left.T / root[:, None] / sigma_V, axes.T, variance / variance.max())

    def gravity(self, outputs_V: FloatArray, steps: int = 2) -> FloatArray:
        """(3, n) gravity in package axes of (n, S) outputs, of unit length to the order of `steps`."""
        u = self.to_principal @ outputs_V.T
        u -= self._shift
        s = u * u
        first, second = self.variance @ s, self._variance_squared @ s
        excess = s[0] + s[1]
        excess += s[2]
        excess -= 1.0
        multiplier = excess / first
        multiplier *= 0.5
        bent = second / first
        bent *= multiplier
        bent *= 1.5
        bent += 1.0
        multiplier *= bent
        p = self.variance[:, None]
        for _ in range(steps - 1):
            shrunk = 1.0 / (1.0 + multiplier * p)
            t = s * shrunk * shrunk
            multiplier += (t.sum(axis=0) - 1.0) / (2.0 * (self.variance @ (t * shrunk)))
        u /= p * multiplier + 1.0
        return np.asarray(self.to_package @ u)

    def angles_deg(self, outputs_V: ArrayLike, steps: int = 1) -> tuple[FloatArray, FloatArray]:
        """Pitch, within +-90 deg, and roll of (n, S) outputs in volts; (n,) each.

        Args:
            outputs_V: (n, S), sensors in the order of the matrix.
            steps: corrections. One is within 1e-9 rad of least squares for noise of 1e-5 g, two within 1e-9 rad for
                1e-4 g, also where the sensors differ by a factor of ten (benchmarks/bench_inverse.py speed).

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
