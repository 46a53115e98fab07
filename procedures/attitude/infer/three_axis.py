"""Attitude of a three-axis package, fast: eqs. (99) to (102) without trigonometry before the last two arctangents.

The weighted least-squares attitude makes (v - b - M g)' W (v - b - M g) least among unit vectors g. With
g0 = M^-1 (v - b) and the principal axes of M'WM as coordinates it is

    u_i = u0_i / (1 + l p_i),   sum of u_i^2 = 1,

one unknown l that is zero where the outputs make exactly 1 g; p are the principal variances. In powers of the excess
e = |u0|^2 - 1, with P = sum p u0^2 and Q = sum p^2 u0^2,

    l = (e / 2P) (1 + (3Q / 2P) (e / 2P)) + ...,

which is the first correction, within the cube of the outputs' relative error; each that follows is a step of Newton's
method and doubles the digits. Outputs far from 1 g need more: from the left of the solution, Newton's method for the
inverse length 1/|u|, which is concave, never goes past it (J. J. More and D. C. Sorensen, SIAM J. Sci. Stat. Comput. 4,
553, 1983).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from rig.fitter.arrays import FloatArray
from rig.fitter.errors import FitError
from rig.procedures.attitude.infer.package import DEGREE, angles

_NEAR = 2e-5
"""Multiplier below which the first correction, within some cubes of it, is within the rounding."""

_SETTLED = 1e-9
"""Change of the multiplier after which the next one is its square: below the rounding."""

_USUAL, _MOST = 2, 20
"""Steps after the first correction that all readings are given, and most steps from the left of those that need more:
16 were the most of 80,000 random ones, from 0.001 to 1,000 g, of sensors whose noise differs by up to ten thousand.
"""

_END = 1e-13
"""Relative change of the multiplier after which the next one is below the rounding."""

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
    def _sums(self) -> FloatArray:
        powers = np.arange(3)[:, None]
        return np.asarray(self.variance**powers)

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

    def gravity(self, outputs_V: FloatArray, steps: int | None = None) -> FloatArray:
        """(3, n) gravity in package axes of (n, S) outputs, of unit length.

        Args:
            outputs_V: (n, S).
            steps: corrections; None: to the end, whatever the outputs are.
        """
        u = self.to_principal @ outputs_V.T
        if self._shift.any():
            u -= self._shift
        s = u * u
        excess, first, bent = self._sums @ s
        excess -= 1.0
        first = np.divide(1.0, first, out=first)
        excess *= first
        multiplier = excess
        multiplier *= 0.5
        bent *= first
        bent *= multiplier
        bent *= 1.5
        bent += 1.0
        multiplier *= bent
        p = self.variance[:, None]
        shrunk = np.empty_like(u)
        settled = np.abs(multiplier).max(initial=0.0) < _NEAR
        for _ in range(0 if settled else _USUAL if steps is None else steps - 1):
            np.multiply(p, multiplier, out=shrunk)
            shrunk += 1.0
            np.divide(1.0, shrunk, out=shrunk)
            np.multiply(u, shrunk, out=s)
            s *= s
            change = s.sum(axis=0)
            change -= 1.0
            s *= shrunk
            change /= (2.0 * self.variance) @ s
            multiplier += change
            settled = np.abs(change, out=change).max(initial=0.0) < _SETTLED
            if settled:
                break
        if steps is None and not settled:
            far = np.flatnonzero(~(change < _SETTLED) | (multiplier <= -1.0))
            multiplier[far] = self._to_the_end(u[:, far])
        np.multiply(p, multiplier, out=shrunk)
        shrunk += 1.0
        u /= shrunk
        return np.asarray(self.to_package @ u)

    def _to_the_end(self, u: FloatArray) -> FloatArray:
        """(n,) multiplier of (3, n) outputs in principal axes, of any size; NaN of those that are not finite."""
        p = self.variance[:, None]
        found = ((np.abs(u) - 1.0) / p).max(axis=0)  # no component may be longer than 1 g: left of the solution
        for _ in range(_MOST):
            shrunk = 1.0 / (1.0 + p * found)
            squares = (u * shrunk) ** 2
            length = squares.sum(axis=0)
            change = (np.sqrt(length) - 1.0) * length / (self.variance @ (squares * shrunk))
            found += change
            if not (np.abs(change) > _END * (1.0 + np.abs(found))).any():
                break
        return np.asarray(found)

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
                found = angles(self.gravity(outputs[part], steps))
                np.multiply(found[0], DEGREE, out=pitch[part])
                np.multiply(found[1], DEGREE, out=roll[part])
        return pitch, roll
