"""Least squares to all digits of a double, if rounding errors of a first solution are too large.

The first triangle R makes the columns orthonormal but for its rounding errors: B = X R^-1, B'B = I + small. The
remainder is computed with twice the digits, without loss by cancellation, and corrected with the same triangle. (That
an inverse wrong in all digits still makes a good preconditioner: Rump 1990. A second Cholesky QR: Yamamoto,
Nakatsukasa, Yanagisawa and Fukaya 2015.)

    (X'X)^-1 = R^-1 (B'B)^-1 R'^-1        c = R^-1 (B'B)^-1 B'y

Both hold for any R^-1, so its own errors cancel. Columns that a double cannot represent, such as tenth powers, come
with their rounding errors; otherwise the rounding of the columns times the condition number is the limit.
"""

from __future__ import annotations

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.double_double import DoubleDouble

_PASSES = 3
_NEAR = 1e-3
"""If B'B is as far as this from I, it is computed again with the corrected R^-1: only near the limit of dependence."""
_STEPS = 4
"""Number of corrections of (B'B)^-1 B'y, each to a thousandth of the previous error, or at once to rounding."""


@np.errstate(over="ignore", invalid="ignore")  # magnitudes beyond 1e300 give None
def refine(
    columns: FloatArray, tails: FloatArray | None, y: FloatArray, root: FloatArray
) -> tuple[FloatArray, FloatArray, float] | None:
    """Coefficients, (k, k) root of (X'X)^-1 and residual sum of squares, to the rounding of their doubles.

    Args:
        columns: (n, k).
        tails: (n, k) rounding errors of the doubles in `columns`; None for zero.
        y: (n,).
        root: (k, k) with root @ root.T near (X'X)^-1.

    Returns:
        None if `root` is too inaccurate for a correction, or magnitudes are beyond 1e300.
    """
    x = DoubleDouble(columns, np.zeros_like(columns) if tails is None else tails)
    for _ in range(_PASSES):
        basis = _times(x, root)
        gram = _gram(basis)
        try:
            triangle = np.linalg.cholesky(gram.hi).T
        except np.linalg.LinAlgError:
            return None
        better = np.linalg.solve(triangle.T, root.T).T
        off = float(np.max(np.abs(gram.hi - np.eye(len(root)))))
        if off < _NEAR:
            break
        root = better
    else:
        return None
    along = (basis * y[:, None]).sum()
    z = DoubleDouble.of(np.zeros(len(root)))
    for _ in range(_STEPS):
        left = along - _times(gram, z)
        step = np.linalg.solve(triangle, np.linalg.solve(triangle.T, left.hi))
        z = z + step
        if np.all(np.abs(step) <= 1e-20 * np.max(np.abs(z.hi), initial=0.0)):
            break
    coefficients = _times(DoubleDouble.of(root), z)
    residual = DoubleDouble.of(y) - _times(x, coefficients)
    rss = float((residual * residual).sum().hi)
    return (coefficients.hi, better, rss) if np.isfinite([*coefficients.hi, rss]).all() else None


def _times(matrix: DoubleDouble, right: FloatArray | DoubleDouble) -> DoubleDouble:
    """(n, m) or (n,) product of (n, k) `matrix` with (k, m) or (k,) `right`."""
    right = right if isinstance(right, DoubleDouble) else DoubleDouble.of(right)
    vector = right.hi.ndim == 1
    total = DoubleDouble.of(np.zeros((len(matrix.hi), *right.hi.shape[1:])))
    for j in range(matrix.hi.shape[1]):
        total = total + (matrix[:, j] if vector else matrix[:, j, None]) * right[j]
    return total


def _gram(basis: DoubleDouble) -> DoubleDouble:
    """(k, k) B'B; column by column, to save memory."""
    rows = [(basis * basis[:, j, None]).sum() for j in range(basis.hi.shape[1])]
    return DoubleDouble(np.stack([r.hi for r in rows]), np.stack([r.lo for r in rows]))
