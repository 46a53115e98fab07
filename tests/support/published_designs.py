"""Designs printed by others, point by point, and the model most of them are for."""

from __future__ import annotations

import numpy as np

LEVELS = (-1.0, 0.0, 1.0)

# B. Jones and P. Goos, I-optimal versus D-optimal split-plot response surface designs, J. Quality Technology 44 (2012)
# 85: Table 1 (20 independent points, printed as two factors at three levels; the I-optimal one follows from its printed
# variances) and Table 2 (4 whole plots of 5; w is hard to change).
INDEPENDENT_I = np.array([(-1, -1), (-1, 1), (1, -1), (1, 1), (-1, 0), (1, 0), (0, -1), (0, 1)] * 2 + [(0, 0)] * 4)
FIVES = np.repeat(np.arange(4), 5)
SPLIT_D = np.column_stack([np.repeat([-1, 0, 1, 1], 5), [-1, -1, 0, 1, 1, -1, -1, 0, 0, 1] + [-1, -1, 0, 1, 1] * 2])
SPLIT_I = np.column_stack([np.repeat([-1, 0, 0, 1], 5), [-1, -1, 0, 1, 1] + [-1, 0, 0, 0, 1] * 2 + [-1, -1, 0, 1, 1]])

# B. Jones and P. Goos, An algorithm for finding D-efficient equivalent-estimation second-order split-plot designs,
# J. Quality Technology 44 (2012) 363: one hard factor and two easy ones; 5 whole plots of 4, and 6 of 4.
EQUIVALENT_20 = [
    [(1, -1, 1), (1, 0, -1), (1, 1, 0), (1, 1, 1)],
    [(-1, -1, -1), (-1, -1, 1), (-1, 1, -1), (-1, 1, 1)],
    [(0, -1, -1), (0, -1, 1), (0, 0, 0), (0, 1, -1)],
    [(1, -1, 0), (1, 0, 1), (1, 1, -1), (1, 1, 1)],
    [(-1, -1, -1), (-1, -1, 1), (-1, 1, -1), (-1, 1, 1)],
]
EQUIVALENT_24 = [
    [(-1, -1, -1), (-1, -1, 1), (-1, 1, -1), (-1, 1, 1)],
    [(1, -1, -1), (1, 0, 1), (1, 1, -1), (1, 1, 0)],
    [(1, -1, 0), (1, 0, -1), (1, 1, -1), (1, 1, 1)],
    [(-1, -1, -1), (-1, -1, 1), (-1, 1, -1), (-1, 1, 1)],
    [(1, -1, 0), (1, 0, -1), (1, 1, -1), (1, 1, 1)],
    [(0, -1, -1), (0, -1, 1), (0, 0, 0), (0, 1, 0)],
]

# Printed by AlgDesign 1.x (R; V. V. Fedorov's exchange) for 14 points of 3^3 and a quadratic model, on the list R-help,
# November 2011: D 0.4630447, A 3.22, Ge 0.893.
FOURTEEN = np.array(
    [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    + [(-1, 0, 0), (1, 0, 0), (0, -1, 0), (0, 1, 0), (0, 0, -1), (0, 0, 1)]
)

# M. J. Box and N. R. Draper, Technometrics 13 (1971) 731: the D-optimal six points for a quadratic model in a square.
DELTA = (4.0 - np.sqrt(13.0)) / 3.0
SIX = np.array([(-1, -1), (1, -1), (-1, 1), (-DELTA, -DELTA), (1, 3 * DELTA), (3 * DELTA, 1)])

# Largest determinants of n x n matrices of -1 and 1 (OEIS A003433; H. Ehlich, Math. Z. 83 (1964) 123).
LARGEST_DETERMINANTS = {2: 2, 3: 4, 4: 16, 5: 48, 6: 160, 7: 576, 8: 4096, 9: 14336, 10: 73728}


def quadratic(points):
    """(n, p) constant, linear terms, products, squares."""
    x = np.asarray(points, float)
    k = x.shape[1]
    products = [x[:, i] * x[:, j] for i in range(k) for j in range(i + 1, k)]
    return np.column_stack([np.ones(len(x)), x, *products, x**2])


def linear(points):
    """(n, 1 + k) constant and linear terms."""
    return np.column_stack([np.ones(len(points)), points])


def dense_information(rows, plot, eta):
    """X'V^-1 X with V written out; sigma = 1."""
    z = np.eye(int(max(plot)) + 1)[np.asarray(plot)]
    return rows.T @ np.linalg.inv(np.eye(len(rows)) + eta * z @ z.T) @ rows
