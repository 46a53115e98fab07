"""Score of each unit of candidates beyond the present model, against the error of its own stratum.

Outputs are divided by their own point-by-replication error, so that sensors have equal weight. A unit is one column, or
several that are judged together (sine and cosine of one frequency). Its score is Wald's F, the square of Student's t
for one column, with the largest of several errors:

- the point-by-replication error; between points the lack of fit instead, if more than error remains there after the
  unit, so that an unknown cause does not add effects that slightly resemble it;
- for those near significance, also the errors of `robust.py`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.quantiles import f_limit
from rig.fitter.trace.aliases import NOTHING_LEFT
from rig.fitter.trace.whitened import Whitened
from rig.procedures.attitude.trace.levels import Level
from rig.procedures.attitude.trace.problem import Problem

RESOLVED = 1e-12
"""Relative size of an output's range below which differences are rounding; data without noise are not tested against
it.
"""


@dataclass(frozen=True, eq=False)
class Scores:
    """One entry per unit, (U,); zero and one for a unit that is in the model or cannot be judged.

    Attributes:
        f: score, in squared standard errors per column.
        rank: number of independent columns beside the model.
        df: degrees of freedom of the used error.
        p: probability of a larger score by chance, for this unit alone.
        gain: fall of the residual sum of squares, in units of the error's variance.
        sign: of the coefficient; zero for units of several columns.
    """

    f: FloatArray
    rank: IntArray
    df: FloatArray
    p: FloatArray
    gain: FloatArray
    sign: FloatArray


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


def score(problem: Problem, chosen: Sequence[int], of: Sequence[int] | None = None) -> Scores:
    """Score units (those `of` interest, or all) beside the `chosen` candidates, each at its level."""
    count = len(problem.units)
    scores = Scores(
        f=np.zeros(count),
        rank=np.zeros(count, np.int64),
        df=np.ones(count),
        p=np.ones(count),
        gain=np.zeros(count),
        sign=np.zeros(count),
    )
    sigma = errors(problem, chosen)
    levels: tuple[Level, ...] = ("replications", "points")
    able = np.zeros(count, np.bool_)
    able[list(range(count) if of is None else of)] = True
    able[[problem.unit_of[j] for j in chosen]] = False
    for level in levels:
        if problem.levels.df(level) <= len(chosen) + 1:
            continue
        within = beside(problem, "points", chosen, np.zeros(0, np.int64), sigma).square
        for at, units, candidates in problem.units_alike:
            wanted = able[units]
            if at != level or not np.any(wanted):
                continue
            same, here = units[wanted], candidates[wanted]
            length2 = np.sum((problem.length[:, here] / sigma[:, None, None]) ** 2, axis=0)
            left = beside(problem, level, chosen, here, sigma)
            _judge(problem, level, len(chosen), scores, same, _Units(left, length2), within)
    return scores


@dataclass(frozen=True, eq=False)
class _Units:
    """U units of q candidates each.

    Attributes:
        left: products, (S, U, q, q), (S, U, q) and (S,).
        length2: (U, q) squared lengths of the original columns.
    """

    left: Products
    length2: FloatArray


def _judge(
    problem: Problem, level: Level, chosen: int, scores: Scores, units: IntArray, of: _Units, within: FloatArray
) -> None:
    """Fill in the scores of `units` with this number of columns each."""
    left = of.left
    spread = inverse(left.columns.sum(axis=0), of.length2)
    d = left.outputs.sum(axis=0)
    gamma = (spread @ d[:, :, None])[:, :, 0]
    norm2 = np.einsum("sujj->su", left.columns)
    rank = np.rint(np.einsum("ujk,ukj->u", spread, left.columns.sum(axis=0))).astype(np.int64)
    can = rank > 0
    after = left.square[:, None] - 2 * np.einsum("suj,uj->su", left.outputs, gamma)
    after += np.einsum("uj,sujk,uk->su", gamma, left.columns, gamma)
    inflation, df = _lack_of_fit(problem, level, chosen, after, norm2, within)
    meat = np.einsum("su,sujk->ujk", inflation, left.columns)
    wald = np.einsum("uj,ujk,uk->u", d, inverse(meat, of.length2), d)
    gain = np.where(can, np.einsum("uj,uj->u", gamma, d), 0.0)
    f = np.where(can, np.minimum(wald, gain) / np.maximum(rank, 1), 0.0)
    scores.f[units], scores.rank[units], scores.df[units] = f, rank, df
    scores.gain[units] = gain
    scores.sign[units] = np.sign(d[:, 0]) if d.shape[1] == 1 else 0.0
    scores.p[units] = np.where(can, special.fdtrc(np.maximum(rank, 1), df, np.maximum(f, 0.0)), 1.0)


def _lack_of_fit(
    problem: Problem, level: Level, chosen: int, after: FloatArray, norm2: FloatArray, within: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Error for the test of units: pure error, or the lack of fit if more than error remains.

    Args:
        problem: the run.
        level: level of the test.
        chosen: number of candidates in the model.
        after: (S, U) residual sum of squares beside each unit, over each sensor's error.
        norm2: (S, U) squared length of the units' columns.
        within: (S,) residual sum of squares point by replication.

    Returns:
        (S, U) mean square of that error over the pure error's, and (U,) its degrees of freedom.
    """
    count, units = norm2.shape
    pure, plain = problem.levels.df("points"), np.ones((count, units))
    if pure <= 0:
        return plain, np.full(units, float(problem.levels.df(level) - chosen - 1))
    lof = problem.levels.n_points - problem.levels.declared.shape[1] - chosen - 1
    if level == "points" or lof <= 0:
        return plain, np.full(units, float(pure * count))
    ratio = (after - within[:, None]) / lof
    inflation = np.where(ratio > f_limit(0.95, lof, pure), ratio, 1.0)
    concerned = norm2 > 0.05 * norm2.sum(axis=0)
    return inflation, np.where(np.any((inflation > 1.0) & concerned, axis=0), float(lof), float(pure * count))
