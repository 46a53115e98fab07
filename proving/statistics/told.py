"""Power of a test that is told the true columns, where errors of neighbours may be correlated.

It compares the likelihoods with the columns and without them, each at the likeliest covariance of some that are
possible, and holds its level under each of these.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray
from scipy import special

from rig.fitter.arrays import FloatArray

Root = NDArray[np.floating[Any]]
PART = 1000
"""Draws that are worked out at once."""
TAIL = 0.01
"""Share of the draws whose gains are taken for the tail of an exponential distribution."""


def free_of(declared: FloatArray) -> FloatArray:
    """(m, n) orthonormal rows on which the declared columns (n, k) are zero; m = n - rank."""
    left, singular, _ = np.linalg.svd(declared)
    return np.asarray(left[:, int(np.sum(singular > 1e-8 * singular[0])) :].T)


def powers(
    columns: FloatArray,
    added: Mapping[str, FloatArray],
    roots: Sequence[Root],
    held: Mapping[str, int],
    level: float,
    rng: Generator,
    draws: tuple[int, int] = (40_000, 4000),
) -> dict[str, dict[str, float]]:
    """Power by size of the effect, and by the covariances under which the level is held.

    Args:
        columns: (m, r) what the test is told, beside the declared model.
        added: (m,) true effects in units of the independent error's sd, by name of their size.
        roots: (m, m) lower roots of the possible covariances, the true one first.
        held: number of these that the test allows for, by name.
        level: of the test.
        rng: of the errors.
        draws: without and with the effect.

    """
    whiten = [np.linalg.inv(root).T.astype(np.float32) for root in roots]
    bases = [np.linalg.qr(own.T @ columns)[0].astype(np.float32) for own in whiten]
    log_det = [2.0 * float(np.sum(np.log(np.diag(root)))) for root in roots]

    rank = columns.shape[1]
    df = len(columns) - rank

    def gains(z: FloatArray) -> FloatArray:
        """(R, draws) -log p of the F test with as large a likelihood ratio, where the first covariance is possible, the
        first two, and so on.
        """
        likely = []
        for own, basis, det in zip(whiten, bases, log_det, strict=True):
            white = z.astype(np.float32) @ own
            rss = np.sum(white**2, axis=1, dtype=np.float64)
            rest = rss - np.sum((white @ basis) ** 2, axis=1, dtype=np.float64)
            likely.append(-0.5 * (len(columns) * np.log(np.stack([rest, rss])) + det))
        best = np.maximum.accumulate(likely, axis=0)
        ratio = np.expm1(2.0 / len(columns) * (best[:, 0] - best[:, 1])) * df / rank
        return np.asarray(-np.log(special.fdtrc(rank, df, np.maximum(ratio, 0.0))))

    def drawn(count: int, effect: FloatArray | float, root: Root) -> FloatArray:
        """(R, count) gains, worked out in parts that fit into the processor's cache."""
        parts = [min(PART, count - at) for at in range(0, count, PART)]
        errors = (rng.standard_normal((part, len(columns))) for part in parts)
        return np.concatenate([gains(effect + z @ root.T) for z in errors], axis=1)

    chance = [_limits(drawn(draws[0], 0.0, root), level) for root in roots]
    with_it = {name: drawn(draws[1], effect, roots[0]) for name, effect in added.items()}
    limits = {most: max(one[count - 1] for one in chance[:count]) for most, count in held.items()}
    return {
        name: {most: float(np.mean(gain[count - 1] > limits[most])) for most, count in held.items()}
        for name, gain in with_it.items()
    }


def _limits(gains: FloatArray, level: float) -> list[float]:
    """What each of some gains (R, draws) exceeds with a probability; beyond the largest `TAIL` as an exponential."""
    if level >= TAIL:
        return [float(one) for one in np.quantile(gains, 1.0 - level, axis=1)]
    start = np.quantile(gains, 1.0 - TAIL, axis=1)
    mean = [float(np.mean(own[own > least])) - least for own, least in zip(gains, start.tolist(), strict=True)]
    return [float(least + more * np.log(TAIL / level)) for least, more in zip(start, mean, strict=True)]
