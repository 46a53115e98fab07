"""How the angles move with the outputs: gains of weighted least squares on the sphere of gravity."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.procedures.attitude.infer.package import on_parallel
from rig.procedures.attitude.infer.singular import normal


@dataclass(frozen=True, eq=False)
class Tangent:
    """Gains of weighted least squares along the sphere of gravity (eqs. 89, 103).

    A direction t that is orthogonal to gravity g has the gains slope @ (t - g (b.t)/(b.g)), b = across @ g: what the
    outputs say of it beyond what they say of the length of g, which is known.

    Attributes:
        slope: (S, 3) g/V, gravity by outputs; of two sensors in the plane of their axes.
        across: (3, 3) covariance of gravity by outputs, of any size; of two sensors the variance out of their plane.
    """

    slope: FloatArray
    across: FloatArray

    @staticmethod
    def of(matrix: FloatArray, weights: FloatArray) -> Tangent:
        """Of (S, 3) V/g and (S,) inverse variances of the outputs, two sensors or more."""
        if len(matrix) == 2:
            n = normal(matrix)
            return Tangent(np.asarray(np.linalg.pinv(matrix).T, np.float64), np.asarray(np.outer(n, n), np.float64))
        root = np.sqrt(weights)[:, None]
        left, size, axes = np.linalg.svd(matrix * root, full_matrices=False)
        inverse = axes.T / size
        return Tangent(root * left @ inverse.T, inverse @ inverse.T * size[-1] ** 2)

    def gains(self, g: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(S, 2, n) rad/V up the meridian and along the parallel (`package.directions`), and (n,) cosine of pitch, at
        (3, n) gravity.

        Both parts t - g (b.t)/(b.g) are orthogonal to b, and each to the other direction: products with b alone.
        """
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            b = self.across @ g
            b /= np.einsum("in,in->n", b, g)
            y, z, c = on_parallel(g)
            moved = np.empty((3, 2, c.size))
            up, along = moved[:, 0], moved[:, 1]
            np.add(y * b[1], z * b[2], out=up[0])
            np.multiply(y, -b[0], out=up[1])
            np.multiply(z, -b[0], out=up[2])
            np.multiply(g[0], y * b[2] - z * b[1], out=along[0])
            np.subtract(c * b[2], g[0] * up[2], out=along[1])
            np.subtract(g[0] * up[1], c * b[1], out=along[2])
            return np.asarray((self.slope @ moved.reshape(3, -1)).reshape(-1, 2, c.size)), c
