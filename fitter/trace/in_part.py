"""Whether some of the rows by themselves follow a shape: those of one person, one range, one direction.

What happens only with them is a small part of all rows' sum of squares, and looks there like larger noise. Here the
model is fitted to these rows alone, and their own scatter is the error: neither other levels of the response nor
other noise elsewhere can look like a shape.
"""

from __future__ import annotations

import numpy as np
from scipy import special

from rig.fitter.arrays import FloatArray
from rig.fitter.linear import orthonormal
from rig.fitter.trace.flexible import NOTHING_LEFT

FEWEST = 16
"""Rows of a part, at least."""
LEAST_DF = 8
"""Degrees of freedom beside the shape: fewer do not determine the error well enough for small probabilities."""
MOST_OF_A_ROW = 0.9
"""Leverage of a row for which its contribution is corrected, at most."""


def p_in_part(left: FloatArray, taken: FloatArray, columns: FloatArray) -> tuple[float, float]:
    """Probability by chance of so much of a shape, and the sum of squares that it takes up.

    The larger of two: of F, and of Wald's statistic from each row's own contribution, corrected for its leverage
    (MacKinnon and White, J. Econometrics 29 (1985) 305, HC2): scatter may differ from row to row.

    Args:
        left: (m,) residual of the part's rows.
        taken: (m, k) columns of the model there.
        columns: (m, q) of the shape there.

    """
    model = orthonormal(taken, None, 1e-6)
    length = np.linalg.norm(columns, axis=0)
    own = columns - model @ (model.T @ columns)
    basis = orthonormal(own, np.maximum(length, np.finfo(float).tiny), NOTHING_LEFT)
    left = left - model @ (model.T @ left)
    rank, below = basis.shape[1], left.size - model.shape[1] - basis.shape[1]
    if rank < 1 or below < LEAST_DF:
        return 1.0, 0.0
    along = basis.T @ left
    gain, rest = float(along @ along), left - basis @ along
    error = max(float(rest @ rest), np.finfo(float).tiny) / below
    f = gain / rank / error
    if special.fdtrc(rank, below, f) > 0.05:  # nobody asks how much more than this
        return float(special.fdtrc(rank, below, f)), gain
    leverage = np.sum(model**2, axis=1) + np.sum(basis**2, axis=1)
    rest = rest / np.sqrt(np.maximum(1.0 - leverage, 1.0 - MOST_OF_A_ROW))
    values, vectors = np.linalg.eigh((basis * rest[:, None] ** 2).T @ basis)
    floor = np.finfo(float).eps * max(float(values[-1]), np.finfo(float).tiny) * values.size
    wald = float(np.sum((vectors.T @ along) ** 2 / np.maximum(values, floor))) / rank
    return float(special.fdtrc(rank, below, max(min(f, wald), 0.0))), gain
