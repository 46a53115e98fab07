"""How the angles move with the outputs: gains of weighted least squares on the sphere of gravity."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fitter.arrays import FloatArray
from procedures.attitude.infer.singular import normal


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

    def gains(self, g: FloatArray, turns: FloatArray) -> FloatArray:
        """(S, k, n) rad/V of (3, k, n) directions at (3, n) gravity."""
        b = self.across @ g
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            share = np.einsum("in,ikn->kn", b, turns)
            share /= np.einsum("in,in->n", b, g)
            moved = share * g[:, None]
            np.subtract(turns, moved, out=moved)
        return np.asarray((self.slope @ moved.reshape(3, -1)).reshape(-1, *share.shape))
