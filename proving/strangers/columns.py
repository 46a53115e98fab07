"""Selection of columns on their products: stepwise by BIC, the lasso, thresholded least squares."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rig.fitter.arrays import FloatArray

SWEEPS = 60
"""Maximum number of sweeps of the lasso over its active columns at one penalty."""
RIDGE = 0.1
"""Of thresholded least squares, over a column's squared length: columns as alike as those of a searched constant come
apart without it."""


@dataclass(frozen=True, eq=False)
class Products:
    """Products of columns (n, J) and a response (n,).

    Attributes:
        gram: (J, J).
        dot: (J,).
        square: of the response.
        n: rows.

    """

    gram: FloatArray
    dot: FloatArray
    square: float
    n: int

    @classmethod
    def of(cls, columns: FloatArray, y: FloatArray) -> Products:
        """All rows."""
        return cls(columns.T @ columns, columns.T @ y, float(y @ y), len(y))

    def without(self, columns: FloatArray, y: FloatArray) -> Products:
        """The same without some rows."""
        gram, dot = self.gram - columns.T @ columns, self.dot - columns.T @ y
        return Products(gram, dot, self.square - float(y @ y), self.n - len(y))


def stepwise(p: Products, *, price: float = 1.0, most: int = 60) -> list[int]:
    """Columns kept: forward one at a time while BIC falls, each time followed by backward.

    Args:
        p: products of columns and response.
        price: of a column, in units of ln n.
        most: columns.

    """
    gram, dot, square, n = p.gram, p.dot, p.square, p.n
    kept: list[int] = []
    best = n * float(np.log(square / n))
    diagonal = np.diag(gram).copy()

    def bic(terms: Sequence[int]) -> float:
        picked = list(terms)
        solved = np.linalg.lstsq(gram[np.ix_(picked, picked)], dot[picked], rcond=1e-10)[0] if picked else np.zeros(0)
        left = max(square - float(dot[picked] @ solved), 1e-12 * square)
        return n * float(np.log(left / n)) + price * len(picked) * float(np.log(n))

    while len(kept) < min(n // 3, most):
        if kept:
            rhs = np.column_stack([gram[kept], dot[kept]])
            solved = np.linalg.lstsq(gram[np.ix_(kept, kept)], rhs, rcond=1e-10)[0]
            left2 = diagonal - np.einsum("kj,kj->j", gram[kept], solved[:, :-1])
            left = dot - gram[:, kept] @ solved[:, -1]
        else:
            left2, left = diagonal.copy(), dot
        gain = np.where(left2 > 1e-6 * diagonal, left**2 / np.maximum(left2, 1e-300), 0.0)
        gain[kept] = 0.0
        if not gain.size:
            break
        trial = [*kept, int(np.argmax(gain))]
        value = bic(trial)
        if value >= best:
            break
        kept, best = trial, value
        while len(kept) > 1:
            value, drop = min((bic([k for k in kept if k != one]), one) for one in kept)
            if value >= best:
                break
            kept, best = [k for k in kept if k != drop], value
    return kept


def lasso_path(p: Products, penalties: FloatArray) -> FloatArray:
    """(L, J) coefficients at falling penalties, by coordinate descent over the active columns."""
    out = np.zeros((len(penalties), len(p.dot)))
    beta, left = np.zeros(len(p.dot)), p.dot.copy()  # left: products of the columns with the residual
    diagonal = np.maximum(np.diag(p.gram), 1e-300)
    for i, penalty in enumerate(penalties):
        active = np.flatnonzero(beta).tolist()
        for _ in range(20):
            _descend(p.gram, diagonal, beta, left, active, float(penalty))
            new = np.flatnonzero((np.abs(left) > penalty * (1 + 1e-6)) & (beta == 0.0))
            new = new[np.argsort(-np.abs(left[new]))][:20]
            if not new.size:
                break
            active = [*np.flatnonzero(beta).tolist(), *new.tolist()]
        out[i] = beta
    return out


def _descend(
    gram: FloatArray, diagonal: FloatArray, beta: FloatArray, left: FloatArray, active: Sequence[int], penalty: float
) -> None:
    """Sweeps over the active columns until none moves; `beta` and `left` are changed in place."""
    if not active:
        return
    picked = np.array(active)
    inner, mine = gram[np.ix_(picked, picked)], left[picked].copy()
    length, own = diagonal[picked], beta[picked].copy()
    for _ in range(SWEEPS):
        largest = 0.0
        for k in range(len(picked)):
            raw = mine[k] + length[k] * own[k]
            value = (abs(raw) - penalty) * (1.0 if raw > 0 else -1.0) / length[k] if abs(raw) > penalty else 0.0
            step = value - own[k]
            if step != 0.0:
                mine -= inner[k] * step
                own[k] = value
                largest = max(largest, abs(step) * length[k])
        if largest < 1e-3 * penalty:
            break
    left -= gram[:, picked] @ (own - beta[picked])
    beta[picked] = own


def thresholded(p: Products, threshold: float, rounds: int = 20) -> FloatArray:
    """(J,) coefficients of ridge regression, those below a threshold taken out, until none is (STLSQ, Brunton 2016)."""
    beta = np.zeros(len(p.dot))
    kept = np.arange(len(p.dot))
    for _ in range(rounds):
        if not kept.size:
            return np.zeros(len(p.dot))
        lengths = np.maximum(np.diag(p.gram)[kept], 1e-6 * p.n)
        ridge = p.gram[np.ix_(kept, kept)] + RIDGE * np.diag(lengths)
        solved = np.linalg.solve(ridge, p.dot[kept])
        stays = np.abs(solved) >= threshold
        beta[:] = 0.0
        beta[kept[stays]] = solved[stays]
        if np.all(stays):
            break
        kept = kept[stays]
    return beta
