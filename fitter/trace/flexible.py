"""Shapes without a name: tests whether the residual follows a smooth curve over a recorded quantity.

A block is a set of columns over one place: waves over the pitch angle, over the time, over the temperature times
gravity, the slowest first. A residual without structure follows none of them by more than chance. If it follows one,
this structure is real, with or without a name in a catalogue.

Each block is tried in a few orders. The statistic is the smaller of F and Wald's statistic, which uses the scatter of
each row's own contribution (White, Econometrica 48 (1980) 817) and is valid for unequal scatter.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special

from rig.fitter import ties
from rig.fitter.arrays import FloatArray
from rig.fitter.linear import orthonormal

NOTHING_LEFT = 1e-2
"""Minimum remaining share of a column beside the model."""
ROUNDING = 1e-9
"""Ratio of a variable's range to its largest value, below which it is constant."""
LEAST_DF = 8
"""Minimum degrees of freedom beside a block: fewer do not determine the error well enough for small probabilities."""


@dataclass(frozen=True, eq=False)
class Block:
    """Columns over one place.

    Attributes:
        place: in words: "over the pitch angle".
        columns: (n, m), the slowest first.
        orders: numbers of columns that are tried together, ascending.
        roughness: (m,) number of half waves of each, at least one.

    """

    place: str
    columns: FloatArray
    orders: tuple[int, ...]
    roughness: FloatArray


@dataclass(frozen=True, eq=False)
class Remainder:
    """The part of a residual that a block explains.

    Attributes:
        place: of the block.
        p: probability of as much by chance, for this block and order only.
        gain: explained sum of squares.
        rank: number of used columns.
        share: explained share of the residual sum of squares.
        shape: (n,) the explained part, row by row.
        basis: (n, rank) orthonormal basis of the used columns.

    """

    place: str
    p: float
    gain: float
    rank: int
    share: float
    shape: FloatArray
    basis: FloatArray


def waves(values: FloatArray, most: int) -> FloatArray:
    """(n, m) half waves over the range of a variable (n,); at most one fewer than its distinct values.

    None over a variable that is constant but for rounding.
    """
    span = float(np.ptp(values))
    if span <= ROUNDING * float(np.max(np.abs(values))):
        return np.empty((values.size, 0))
    u = (values - values.min()) / span
    count = min(most, np.unique(np.round(u, 6)).size - 1)
    return np.asarray(np.cos(np.pi * np.arange(1, count + 1) * u[:, None]))


def turns(angle_deg: FloatArray, most: int) -> FloatArray:
    """(n, 2 m) sine and cosine of up to `most` periods per turn, as far as the angles (n,) determine them."""
    distinct = np.unique(np.round(np.mod(angle_deg, 360.0), 3)).size
    count = min(most, (distinct - 1) // 2)
    angle = np.radians(angle_deg)[:, None] * np.arange(1, count + 1)
    return np.asarray(np.stack([np.cos(angle), np.sin(angle)], axis=2).reshape(angle_deg.size, -1))


def halves(columns: FloatArray) -> FloatArray:
    """(m,) number of half waves of each of `waves` (n, m)."""
    return np.arange(1.0, columns.shape[1] + 1)


def rough_turns(columns: FloatArray) -> FloatArray:
    """(2 m,) number of periods of each of `turns` (n, 2 m)."""
    return np.repeat(np.arange(1.0, columns.shape[1] // 2 + 1), 2)


def orders_of(columns: FloatArray, tried: Sequence[int] = (3, 6, 12)) -> tuple[int, ...]:
    """Orders in which a block of so many columns is tried."""
    most = columns.shape[1]
    return tuple(dict.fromkeys(min(order, most) for order in tried if most))


def remainders(
    left: FloatArray, df: int, blocks: Iterable[Block], project: Callable[[FloatArray], FloatArray]
) -> list[Remainder]:
    """The remainder of each block in its most significant order, the most significant block first.

    Args:
        left: (n,) residual.
        df: its degrees of freedom.
        blocks: to try.
        project: removes the model from columns (n, m).

    """
    found: list[Remainder] = []
    rss = float(left @ left)
    if rss <= 0 or df < 2:
        return []
    for block in blocks:
        if not block.columns.shape[1]:
            continue
        basis, kept = _independent(project(block.columns), np.linalg.norm(block.columns, axis=0))
        best: Remainder | None = None
        for order in block.orders:
            own = basis[:, kept < order]
            rank = own.shape[1]
            if rank < 1 or df - rank < LEAST_DF:
                continue
            along = own.T @ left
            gain = float(along @ along)
            p = _p(own, left, along, rss, df)
            if best is None or ties.below(p, best.p, 0.0):
                best = Remainder(block.place, p, gain, rank, gain / rss, own @ along, own)
        if best is not None:
            found.append(best)
    return ties.ordered(found, key=lambda one: one.p)


DECAYS = (1.0, 2.0, 3.0)
"""Powers of the roughness with which the size of a wave decreases: a kink, a curve, a very smooth curve."""
SIZES = 4.0 ** np.arange(-3, 13)
"""Tried variances of the slowest wave, over the error variance."""
HYPER = 2.0
"""Price in nats of a size and a decay that are estimated from the data."""


def evidence(y: FloatArray, columns: FloatArray, roughness: FloatArray | None = None) -> float:
    """Logarithm of the likelihood ratio of y (n,), of unit error, with smooth columns (n, m) to y without them.

    Coefficients have one normal distribution, whose width maximises the likelihood. For waves it is narrower for
    rougher waves, as in a Gaussian process. The marginal likelihood includes the price of free coefficients.
    """
    if not columns.shape[1]:
        return 0.0
    scale = np.linalg.norm(columns, axis=0)
    kept = scale > 0
    if not np.any(kept):
        return 0.0
    columns = columns[:, kept]
    typical = float(np.max(scale))
    rough = None if roughness is None else roughness[kept]
    return of_products(columns.T @ columns / typical**2, columns.T @ y / typical, rough)


def of_products(gram: FloatArray, along: FloatArray, roughness: FloatArray | None) -> float:
    """`evidence` from products of columns whose longest has length one, (m, m), and theirs with y, (m,)."""
    best = 0.0
    for decay in (0.0,) if roughness is None else DECAYS:
        falls = 1.0 if roughness is None else roughness**-decay
        values, vectors = np.linalg.eigh(gram * np.outer(falls, falls) if roughness is not None else gram)
        values = np.maximum(values, 0.0)
        square = (vectors.T @ (falls * along)) ** 2
        one = 1.0 + SIZES[:, None] * values
        best = max(best, float(np.max(0.5 * np.sum(SIZES[:, None] * square / one - np.log(one), axis=1))))
    return best - (0.0 if roughness is None else HYPER)


def evidence_of(y: FloatArray, effects: Iterable[FloatArray]) -> float:
    """Sum of the evidence for effects (n, m), each beside the effects before it; see `evidence`."""
    left, taken, total = y, np.empty((y.size, 0)), 0.0
    for columns in effects:
        own = columns - taken @ (taken.T @ columns)
        total += evidence(left, own)
        basis = orthonormal(own, None, 1e-6)
        left, taken = left - basis @ (basis.T @ left), np.column_stack([taken, basis])
    return total


def tried(blocks: Iterable[Block]) -> int:
    """Number of tests of the blocks."""
    return sum(len(block.orders) for block in blocks if block.columns.shape[1])


def _p(own: FloatArray, left: FloatArray, along: FloatArray, rss: float, df: int) -> float:
    rank, gain = own.shape[1], float(along @ along)
    below = df - rank
    error = max((rss - gain) / below, np.finfo(float).tiny)
    f = gain / rank / error
    rest = left - own @ along
    meat = (own * rest[:, None] ** 2).T @ own * (left.size / below)
    values, vectors = np.linalg.eigh(meat)
    floor = np.finfo(float).eps * max(float(values[-1]), np.finfo(float).tiny) * values.size
    wald = float(np.sum((vectors.T @ along) ** 2 / np.maximum(values, floor))) / rank
    return float(special.fdtrc(rank, below, max(min(f, wald), 0.0)))


def _independent(columns: FloatArray, length: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(n, r) orthonormal columns in order, and (r,) index of the given column of each."""
    basis = np.empty((columns.shape[0], 0))
    kept: list[int] = []
    for k in range(columns.shape[1]):
        one = columns[:, k] - basis @ (basis.T @ columns[:, k])
        one = one - basis @ (basis.T @ one)
        size = float(np.linalg.norm(one))
        if size > NOTHING_LEFT * length[k] and size > 0:
            basis = np.column_stack([basis, one / size])
            kept.append(k)
    return basis, np.array(kept)
