"""Optimal design measures: shares of an unlimited number of independent points, which limit any design.

D: J. Kiefer and J. Wolfowitz, Canad. J. Math. 12 (1960) 363: a measure with the largest variance d of a prediction,
over candidates and times the number of points, has |M|^(1/p) >= |M*|^(1/p) p / d, with equality for the optimal one.
Linear criteria tr(M^-1 B), among them A and I: V. V. Fedorov, Theory of Optimal Experiments (1972), section 2.9: no
measure is better than tr(M^-1 B)^2 / max f' M^-1 B M^-1 f. Both are bounds for exact designs too, and for whole plots,
whose error only takes information away. Found by multiplicative steps: S. D. Silvey,
D. M. Titterington and B. Torsney, Commun. Statist. A 7 (1978) 1379.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rig.fitter import ties
from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.errors import FitError

CLOSE = 1e-5
"""Relative distance from the bound at which a measure is good enough."""
STEPS = 25
ROUNDS = 160
WORK = 2e9
"""Size of a computation in products, a few seconds, after which a measure is taken as it is."""


@dataclass(frozen=True, eq=False)
class Measure:
    """A design measure.

    Attributes:
        support: (s,) indices of candidates.
        weights: (s,) their shares, sum 1.
        information: (p, p) M, sum of weights times f f'.
        efficiency: lower bound of its own efficiency, at most 1.
    """

    support: IntArray
    weights: FloatArray
    information: FloatArray
    efficiency: float


def optimal_measure(rows: FloatArray, target: FloatArray | None = None, close: float = CLOSE) -> Measure:
    """The D-optimal measure on (C, p) candidate rows, or that of least tr(M^-1 `target`).

    Its efficiency is 1 - `close` or better; for thousands of candidates and dozens of terms it may be less.

    Raises:
        FitError: the candidates do not determine the terms.
    """
    count, p = rows.shape
    active = np.arange(count) if count <= 40 * p else _spread(rows)
    weights = np.full(active.size, 1.0 / active.size)
    work = 0.0
    for _ in range(ROUNDS):
        work += (count + STEPS * active.size) * float(p) ** 2
        weights = _steps(rows[active], weights, target)
        keep = weights > 1e-7 * weights.max()
        active, weights = active[keep], weights[keep] / weights[keep].sum()
        gain, bound = _gain(rows, rows[active], weights, target)
        if gain.max() <= bound * (1.0 + close) or work > WORK:
            break
        worst = np.setdiff1d(ties.top(gain, p), active)
        worst = worst[gain[worst] > bound]
        if worst.size:
            active = np.concatenate([active, worst])
            weights = np.concatenate([weights * 0.98, np.full(worst.size, 0.02 / worst.size)])
    gain, bound = _gain(rows, rows[active], weights, target)
    order = np.argsort(active)
    information = rows[active].T @ (rows[active] * weights[:, None])
    return Measure(
        np.asarray(active[order], np.int64),
        weights[order],
        np.asarray(information),
        float(min(1.0, bound / gain.max())),
    )


def _steps(rows: FloatArray, weights: FloatArray, target: FloatArray | None) -> FloatArray:
    for _ in range(STEPS):
        gain, _ = _gain(rows, rows, weights, target)
        weights = weights * (gain if target is None else np.sqrt(gain))
        weights = weights / weights.sum()
    return weights


def _gain(
    rows: FloatArray, used: FloatArray, weights: FloatArray, target: FloatArray | None
) -> tuple[FloatArray, float]:
    """(C,) improvement by each candidate, and its value at the optimum."""
    information = used.T @ (used * weights[:, None])
    try:
        inverse = np.linalg.inv(information)
    except np.linalg.LinAlgError:
        raise FitError("the candidate points do not determine the model") from None
    if target is None:
        return np.sum((rows @ inverse) * rows, axis=1), float(rows.shape[1])
    product = inverse @ target @ inverse
    return np.sum((rows @ product) * rows, axis=1), float(np.sum(inverse * target))


def _spread(rows: FloatArray) -> IntArray:
    """Indices of a few hundred candidates that determine the terms: largest rows, and evenly taken ones."""
    count, p = rows.shape
    size = np.sum(rows**2, axis=1)
    even = np.linspace(0, count - 1, 20 * p).astype(np.int64)
    return np.union1d(even, np.argsort(-size, kind="stable")[: 20 * p])
