"""Scatter of each sensor's readings beside a model."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.trace.aliases import NOTHING_LEFT
from rig.procedures.attitude.trace.problem import Problem

RESOLVED = 1e-12
"""Relative size of an output's range below which differences are rounding; data without noise are not tested against
it.
"""


def errors(problem: Problem, chosen: Sequence[int]) -> FloatArray:
    """(S,) point-by-replication standard error of each sensor beside the `chosen` candidates, V.

    Where no point is visited twice, the residual of each replication's own fit replaces it.
    """
    level = problem.levels.of_error
    known, picked = problem.products[level], np.array(chosen, np.int64)
    left, df = known.square.copy(), np.full(len(problem.sensors), float(problem.levels.df(level)))
    if picked.size:
        taken, own = known.of(picked[:, None], picked), known.outputs[:, picked]
        known_apart = inverse(taken, problem.length[:, picked] ** 2)
        left -= np.einsum("sj,sjk,sk->s", own, known_apart, own)
        df -= np.rint(np.einsum("sjk,skj->s", known_apart, taken))
    sigma = np.sqrt(np.maximum(left, 0.0) / np.where(df > 0, df, np.nan))
    return np.asarray(np.fmax(sigma, rounding(problem)))


def rounding(problem: Problem) -> FloatArray:
    """(S,) volts below which a residual is rounding and not error."""
    swing = np.array([np.ptp(problem.scene.data.outputs[s]) for s in problem.sensors])
    return np.asarray(RESOLVED * np.maximum(swing, 1.0))


def inverse(products: FloatArray, length2: FloatArray, rank: int | None = None) -> FloatArray:
    """(..., q, q) generalised inverse of products of columns.

    Args:
        products: (..., q, q).
        length2: (..., q) squared reference lengths of columns; a zero column is left out.
        rank: number of independent combinations; by default those with at least `NOTHING_LEFT` remaining.
    """
    scale = np.where(length2 > 0.0, 1.0 / np.sqrt(np.where(length2 > 0.0, length2, 1.0)), 0.0)
    values, vectors = np.linalg.eigh(products * scale[..., :, None] * scale[..., None, :])
    least = np.finfo(float).tiny if rank is not None else NOTHING_LEFT**2
    kept = values > least
    if rank is not None:
        kept &= np.arange(values.shape[-1]) >= values.shape[-1] - rank
    inverted = np.where(kept, 1.0 / np.maximum(values, least), 0.0)
    out = (vectors * inverted[..., None, :]) @ np.swapaxes(vectors, -1, -2)
    return np.asarray(out * scale[..., :, None] * scale[..., None, :])
