"""Errors drawn in strata, and their products with candidates' columns."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.trace.engine.in_strata import InStrata, Single

_TINY = np.finfo(float).tiny


class Drawn(NamedTuple):
    """Errors of a stratum.

    Attributes:
        normal: (r, m) along its `root`.
        dots: (d, m) their products with its columns over their `scale`; none where it has few rows.
        squares: (m,) their sums of squares, with those of what no column has a part of.
    """

    normal: Single
    dots: Single
    squares: FloatArray


def draw(problem: InStrata, at: int, rng: np.random.Generator, count: int, roots: Sequence[FloatArray]) -> list[Drawn]:
    """For each stratum, with its `root`, m draws under a covariance.

    They are divided by the scatter that each draw shows, as a run's errors are: with few degrees of freedom it may be
    far from the true one.
    """
    out = []
    for one, weight, root in zip(problem.strata, problem.weight[at].tolist(), roots, strict=True):
        sd = 1.0 / np.sqrt(weight)
        normal = rng.standard_normal((len(root), count), dtype=np.float32) * np.float32(sd)
        squares = np.einsum("rm,rm->m", normal, normal, dtype=np.float64)
        if (rest := one.df - len(root)) > 0.0:
            squares = squares + rng.chisquare(rest, count) * sd**2
        few = one.rows is not None
        dots = normal[:0] if few else (root / problem.scale[one.own]).T.astype(np.float32) @ normal
        out.append(Drawn(normal, dots, squares))
    weights, rows = problem.weight[at], np.zeros_like(problem.scatter) if problem.pooled else problem.scatter
    for base in np.unique(rows).tolist():
        mine = np.flatnonzero(rows == base)
        told = [k for k in mine.tolist() if problem.of_error[k]]
        shown = sum(float(weights[k]) * out[k].squares for k in told)
        df = sum(problem.strata[k].df for k in told)
        if df > 0.0:
            each = df / np.maximum(shown, _TINY)
            single = np.sqrt(each).astype(np.float32)
            for k in mine.tolist():
                np.multiply(out[k].normal, single, out=out[k].normal)
                np.multiply(out[k].dots, single, out=out[k].dots)
                np.multiply(out[k].squares, each, out=out[k].squares)
    return out


def summed(problem: InStrata, drawn: Sequence[Drawn], weight: FloatArray) -> Single:
    """(D, m) products of all columns, over their `scale`, with drawn errors under the variances of strata (L,)."""
    out = np.zeros((int(problem.start[-1]), drawn[0].normal.shape[1]), np.float32)
    for one, errors, part in zip(problem.strata, drawn, weight.tolist(), strict=True):
        if one.rows is None:
            out[one.own] += np.float32(part) * errors.dots
    for own, of, rows in problem.rowed:
        out[own] += rows.T @ np.concatenate([np.float32(weight[k]) * drawn[k].normal for k in of])
    return out
