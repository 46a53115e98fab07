"""The budgets of `rig.fitter.budget.budget` in numpy, for many rows at once; a row has its own sensitivities.

Welch and Satterthwaite's formula stands here because GTC works through one result at a time.
tests/certificate/test_budget.py holds that both agree to 1e-9.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rig.fitter.arrays import FloatArray
from rig.fitter.budget.coverage import either_side_factor, shape_factor
from rig.fitter.budget.influence import CANCELLED, connected

_PROBABILITY = 0.95


@dataclass(frozen=True, eq=False)
class Combined:
    """Combined uncertainty of n results.

    Attributes:
        standard_uncertainty: (n,)
        df: (n,) effective degrees of freedom.
        coverage_factor: (n,)
        expanded_uncertainty: (n,) for 95 %.

    """

    standard_uncertainty: FloatArray
    df: FloatArray
    coverage_factor: FloatArray
    expanded_uncertainty: FloatArray


def combine(
    sensitivities: FloatArray,
    df: FloatArray,
    type_a: Sequence[tuple[ArrayLike, ArrayLike]] = (),
    *,
    correlation: FloatArray | None = None,
    excess: FloatArray | None = None,
    deviation: ArrayLike = 0.0,
) -> Combined:
    """Combine p influences for each of n results, as `budgets` does, to 1e-9.

    Args:
        sensitivities: (n, p) displacement of each result for one standard uncertainty of each influence.
        df: (p,) degrees of freedom of the influences.
        type_a: variance and degrees of freedom of each further component; each a number or (n,).
        correlation: (p, p) of the influences; as `influence.checked` accepts it.
        excess: (p,) `EXCESS` of the influences' distributions, for coverage factors by shape.
        deviation: (n,) part of known size and of either sign, whose square is in the variances.

    """
    n, p = sensitivities.shape
    r = np.eye(p) if correlation is None else correlation
    if np.shape(df) != (p,) or r.shape != (p, p):
        raise ValueError(f"{p} influences: found degrees of freedom {np.shape(df)} and correlations {r.shape}")
    parts: list[tuple[FloatArray, FloatArray]] = []
    for group in connected(r):
        which = list(group)
        s = sensitivities[:, which]
        part = np.square(s[:, 0]) if len(which) == 1 else np.einsum("ni,ij,nj->n", s, r[np.ix_(which, which)], s)
        parts.append((part, df[which[0]]))
    parts += [(np.asarray(one, dtype=np.float64), np.asarray(its_df, dtype=np.float64)) for one, its_df in type_a]
    shapes = [] if excess is None else excess.tolist()
    bounded = [(one, shapes[one[0]]) for one in connected(r) if len(one) == 1 and shapes and shapes[one[0]]]
    alone = sum((np.square(sensitivities[:, i]) for i in range(p)), start=np.zeros(n))
    variance = sum((part for part, _ in parts), start=np.zeros(n))
    variance = np.where(variance > CANCELLED * alone, variance, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        per_df = sum((np.square(part / variance) / its_df for part, its_df in parts), start=np.zeros(n))
        effective = np.where(per_df > 0.0, 1.0 / per_df, np.inf)
        squares = [np.square(np.square(sensitivities[:, one[0]]) / variance) * shape for one, shape in bounded]
    u = np.sqrt(variance)
    if excess is None:
        share = np.abs(deviation) / np.where(u > 0.0, u, np.inf)
        k = either_side_factor(_PROBABILITY, np.nan_to_num(share), effective)
    else:
        k = shape_factor(_PROBABILITY, 1.0 / effective + np.nan_to_num(sum(squares, start=np.zeros(n))))
    return Combined(u, effective, k, k * u)
