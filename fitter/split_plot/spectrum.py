"""The spectral form of y = X b + Z d + e, in which every quantity of the mixed model is a sum over eigenvalues.

With M the projection off the columns of X and M Z = U diag(s) V' (a singular value decomposition, xi = s^2), and
var(d) = ratio var(e), written with D = 1 / (1 + ratio xi):

    restricted log-likelihood   nu log(q) + sum log(1 + ratio xi),  q = |rest|^2 + sum D u^2,  u = U'y
    coefficients                X+ y - A (ratio s D u),             A = X+ Z V
    their covariance            var(e) [(X'X)^-1 + A diag(ratio D) A'],  a sum of squares: nothing cancels
    conditional residuals       rest + U D u
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg.lapack import dtrtri

from rig.fitter.arrays import FloatArray
from rig.fitter.linear import least_squares


@dataclass(frozen=True, eq=False)
class FixedPart:
    """The columns X, triangularised once.

    Attributes:
        names: of the k columns.
        columns: (n, k).
        basis: (n, k) orthonormal.
        root: (k, k) with columns @ root = basis, so root @ root.T = (X'X)^-1.
        log_det: log determinant of X'X.

    """

    names: tuple[str, ...]
    columns: FloatArray
    basis: FloatArray
    root: FloatArray
    log_det: float

    @classmethod
    def of(cls, columns: FloatArray, names: tuple[str, ...]) -> FixedPart:
        """Triangularise (n, k) `columns`.

        Raises:
            RankError: they are not independent.

        """
        least_squares(columns, np.zeros(len(columns)), names)  # names the dependent columns
        length = np.linalg.norm(columns, axis=0)
        basis, triangle = np.linalg.qr(columns / length)
        root = np.triu(dtrtri(triangle)[0]) / length[:, None]
        log_det = 2.0 * float(np.sum(np.log(np.abs(np.diag(triangle)) * length)))
        return cls(names, columns, basis, root, log_det)

    @property
    def df(self) -> int:
        """Degrees of freedom left beside the columns, n - k."""
        return len(self.columns) - len(self.names)

    def project_out(self, columns: FloatArray) -> FloatArray:
        """(n, m) part of (n, m) `columns` outside X; projected twice, so that nothing of X remains."""
        for _ in range(2):
            columns = columns - self.basis @ (self.basis.T @ columns)
        return columns


@dataclass(frozen=True, eq=False)
class Spectrum:
    """The random columns Z seen through X.

    Attributes:
        fixed: X.
        xi: (r,) eigenvalues above zero of M Z Z' M.
        singular: (r,) their square roots.
        left: (n, r) eigenvectors U, orthogonal to X.
        right: (W, W) V; its first r columns belong to `xi`, the others to combinations of Z that lie within X.
        loading: (k, W) A = X+ Z V.
        basis: (n, k + r) X's basis and `left`, side by side.

    """

    fixed: FixedPart
    xi: FloatArray
    singular: FloatArray
    left: FloatArray
    right: FloatArray
    loading: FloatArray
    basis: FloatArray

    @classmethod
    def of(cls, fixed: FixedPart, random: FloatArray) -> Spectrum:
        """Decompose (n, W) `random`, whose columns are independent."""
        left, singular, right = np.linalg.svd(fixed.project_out(random), full_matrices=False)
        rounding = max(random.shape) * np.finfo(float).eps * float(np.max(np.linalg.norm(random, axis=0)))
        r = min(int(np.sum(singular > 10.0 * rounding)), fixed.df)
        left = np.ascontiguousarray(left[:, :r])
        loading = fixed.root @ (fixed.basis.T @ random) @ right.T
        basis = np.column_stack([fixed.basis, left])
        return cls(fixed, singular[:r] ** 2, singular[:r], left, right.T, loading, basis)

    @property
    def rest_df(self) -> int:
        """Degrees of freedom outside X and Z: the subplot error alone."""
        return self.fixed.df - len(self.xi)

    @property
    def all_xi(self) -> FloatArray:
        """(W,) eigenvalues in the order of `right`, zeros included."""
        return np.concatenate([self.xi, np.zeros(len(self.right) - len(self.xi))])

    @cached_property
    def identity(self) -> FloatArray:
        """(1, W, W) the covariance of independent effects, as in `Structure.shapes`."""
        return np.eye(len(self.right))[None]

    def parts(self, y: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Coordinates of (n,) or (n, m) `y` in X (k, .) and in Z beyond X (r, .), and the remainder (n, .)."""
        coordinates = self.basis.T @ y
        k = len(self.fixed.names)
        return coordinates[:k], coordinates[k:], y - self.basis @ coordinates

    def coefficients(self, in_x: FloatArray, in_z: FloatArray, ratio: FloatArray | float) -> FloatArray:
        """(k, .) generalised least-squares coefficients at variance ratio(s) `ratio` (.,)."""
        xi, s = (self.xi, self.singular) if in_z.ndim == 1 else (self.xi[:, None], self.singular[:, None])
        predicted = ratio * s * in_z / (1.0 + ratio * xi)
        return np.asarray(self.fixed.root @ in_x - self.loading[:, : len(self.xi)] @ predicted)
