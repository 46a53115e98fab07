"""Scatter of each sensor's readings beside a model, and products of candidates over it at one level."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.trace.aliases import NOTHING_LEFT
from rig.fitter.trace.whitened import Whitened
from rig.procedures.attitude.trace.levels import Level
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


def whiten(
    problem: Problem, level: Level, chosen: Sequence[int], sigma: FloatArray, of: Sequence[int] = ()
) -> Whitened:
    """Outputs and columns over `sigma` (S,), with the `chosen` candidates fitted and removed from both.

    Args:
        problem: the run.
        level: further removed parts.
        chosen: candidates in the model.
        sigma: (S,) error of each sensor, V.
        of: the candidates of the columns.
    """
    picked, scale = list(chosen), sigma[:, None]
    length = np.linalg.norm(problem.length[:, picked] / scale, axis=0)
    taken, columns = (problem.columns_at(level, which) / scale[:, :, None] for which in (picked, list(of)))
    return Whitened(problem.outputs_at(level) / scale, columns).beside(taken, length)


@dataclass(frozen=True, eq=False)
class Products:
    """Products at one level over the sensors' errors, with chosen candidates removed from all sensors together.

    Attributes:
        columns: (S, ..., q, q) of candidates, in groups of q.
        outputs: (S, ..., q).
        square: (S,).
    """

    columns: FloatArray
    outputs: FloatArray
    square: FloatArray


def beside(problem: Problem, level: Level, chosen: Sequence[int], here: IntArray, sigma: FloatArray) -> Products:
    """Products of the candidates `here` (..., q) in groups, and of the outputs, beside the `chosen` ones."""
    known, weight = problem.products[level], sigma**-2.0
    each = weight.reshape(-1, *[1] * here.ndim)
    columns = known.of(here[..., :, None], here[..., None, :]) * each[..., None]
    outputs, square = known.outputs[:, here] * each, known.square * weight
    picked = np.array(chosen, np.int64)
    if not picked.size:
        return Products(columns, outputs, square)
    across = known.of(picked[:, None], here[..., None, :]) * each[..., None]
    taken = known.of(picked[:, None], picked) * weight[:, None, None]
    own = known.outputs[:, picked] * weight[:, None]
    length2 = np.sum(problem.length[:, picked] ** 2 * weight[:, None], axis=0)
    spread = inverse(taken.sum(axis=0), length2)
    share, fitted = spread @ across.sum(axis=0), spread @ own.sum(axis=0)
    of, q = (-1, *[1] * (here.ndim - 1)), len(picked)
    cross = np.swapaxes(across, -1, -2) @ share
    cross -= np.swapaxes(share, -1, -2) @ (0.5 * taken.reshape(*of, q, q) @ share)
    columns -= cross
    columns -= np.swapaxes(cross, -1, -2)
    rest = (own - taken @ fitted).reshape(*of, 1, q)
    return Products(
        columns,
        outputs - np.swapaxes(across, -1, -2) @ fitted - (rest @ share)[..., 0, :],
        np.maximum(square - 2 * own @ fitted + (taken @ fitted) @ fitted, 0.0),
    )


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
