"""Columns whitened by every covariance of a grid, as far as their products are asked for.

A product of two columns in the metric of a covariance is a sum over rows once both are whitened. Where the covariance
has a few components along few directions, whitened rows are not needed: it is the product in the metric of the rest,
minus that of what both have along the directions, weighted. So products under hundreds of covariances are one
multiplication of small matrices.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations_with_replacement
from typing import Protocol

import numpy as np

from rig.fitter.arrays import FloatArray, IntArray


class White(Protocol):
    """Whitened columns."""

    def products(self, other: White) -> FloatArray:
        """(G, p, q) products with other columns of the same kind, under every covariance."""

    def squares(self) -> FloatArray:
        """(G, p) sums of squares."""

    def beside(self, other: White) -> White:
        """These and others, side by side."""


class _Whitens(Protocol):
    def whiten(self, which: IntArray, columns: FloatArray) -> FloatArray: ...


class ByRows:
    """A noise whose columns are whitened row by row."""

    def white(self: _Whitens, which: IntArray, columns: FloatArray) -> White:
        """Columns (n, p) whitened by some covariances."""
        return Rows((self.whiten(which, columns),))


@dataclass(frozen=True, eq=False)
class Rows:
    """Whitened rows.

    Attributes:
        blocks: (G, n, p) each, side by side.
    """

    blocks: tuple[FloatArray, ...]

    def products(self, other: White) -> FloatArray:
        """See `White`."""
        assert isinstance(other, Rows)
        across = [np.concatenate([np.matmul(b.mT, o) for o in other.blocks], axis=2) for b in self.blocks]
        return np.concatenate(across, axis=1)

    def squares(self) -> FloatArray:
        """See `White`."""
        return np.concatenate([np.einsum("gnp,gnp->gp", b, b) for b in self.blocks], axis=1)

    def beside(self, other: White) -> White:
        """See `White`."""
        assert isinstance(other, Rows)
        return Rows((*self.blocks, *other.blocks))


@dataclass(frozen=True, eq=False)
class Along:
    """Components along directions beside one other metric.

    Attributes:
        at: (G',) covariances, of those asked for, that have that metric.
        rows: (n, p) columns whitened by it.
        sums: (K, W, p) what they have along W directions of K components.
        weight: (G', K (K + 1) / 2, W) of each pair of components in the products.
    """

    at: IntArray
    rows: FloatArray
    sums: FloatArray
    weight: FloatArray

    def products(self, other: Along) -> FloatArray:
        """(G', p, q)."""
        p, q = self.rows.shape[1], other.rows.shape[1]
        pairs = [
            self.sums[a][:, :, None] * other.sums[b][:, None, :]
            + (self.sums[b][:, :, None] * other.sums[a][:, None, :] if a != b else 0.0)
            for a, b in combinations_with_replacement(range(len(self.sums)), 2)
        ]
        count, pairs_and_ways = len(self.at), self.weight[0].size  # named: a sensor may have no column at all
        taken = self.weight.reshape(count, pairs_and_ways) @ np.stack(pairs).reshape(pairs_and_ways, p * q)
        return np.asarray((self.rows.T @ other.rows)[None] - taken.reshape(count, p, q))

    def beside(self, other: Along) -> Along:
        """These and others, side by side."""
        sums = np.concatenate([self.sums, other.sums], axis=2)
        return replace(self, rows=np.hstack([self.rows, other.rows]), sums=sums)

    def squares(self) -> FloatArray:
        """(G', p)."""
        every = combinations_with_replacement(range(len(self.sums)), 2)
        pairs = np.stack([self.sums[a] * self.sums[b] * (1.0 if a == b else 2.0) for a, b in every])
        taken = self.weight.reshape(len(self.at), -1) @ pairs.reshape(self.weight[0].size, pairs.shape[2])
        return np.asarray(np.einsum("np,np->p", self.rows, self.rows) - taken)


@dataclass(frozen=True, eq=False)
class ByComponents:
    """Columns under a grid of components, of one metric or several.

    Attributes:
        parts: of each metric.
        count: number of covariances.
    """

    parts: tuple[Along, ...]
    count: int

    def products(self, other: White) -> FloatArray:
        """See `White`."""
        assert isinstance(other, ByComponents)
        out = np.empty((self.count, self.parts[0].rows.shape[1], other.parts[0].rows.shape[1]))
        for mine, theirs in zip(self.parts, other.parts, strict=True):
            out[mine.at] = mine.products(theirs)
        return out

    def squares(self) -> FloatArray:
        """See `White`."""
        out = np.empty((self.count, self.parts[0].rows.shape[1]))
        for mine in self.parts:
            out[mine.at] = mine.squares()
        return out

    def beside(self, other: White) -> White:
        """See `White`."""
        assert isinstance(other, ByComponents)
        both = zip(self.parts, other.parts, strict=True)
        parts = tuple(
            Along(m.at, np.hstack([m.rows, o.rows]), np.concatenate([m.sums, o.sums], axis=2), m.weight)
            for m, o in both
        )
        return ByComponents(parts, self.count)


@dataclass(frozen=True, eq=False)
class OfSensors:
    """Columns over the rows of several sensors, most of them zero but in one.

    Attributes:
        parts: of each sensor, its columns that are not zero.
        own: (p',) which these are.
        width: number p of columns.
        count: number of covariances.
    """

    parts: tuple[White, ...]
    own: tuple[IntArray, ...]
    width: int
    count: int = field(kw_only=True)

    def products(self, other: White) -> FloatArray:
        """See `White`."""
        assert isinstance(other, OfSensors)
        out = np.zeros((self.count, self.width, other.width))
        for mine, theirs, p, q in zip(self.parts, other.parts, self.own, other.own, strict=True):
            if len(p) and len(q):
                out[:, p[:, None], q] += mine.products(theirs)
        return out

    def squares(self) -> FloatArray:
        """See `White`."""
        out = np.zeros((self.count, self.width))
        for mine, own in zip(self.parts, self.own, strict=True):
            if len(own):
                out[:, own] += mine.squares()
        return out

    def beside(self, other: White) -> White:
        """See `White`."""
        assert isinstance(other, OfSensors)
        parts = tuple(mine.beside(theirs) for mine, theirs in zip(self.parts, other.parts, strict=True))
        own = tuple(np.concatenate([p, q + self.width]) for p, q in zip(self.own, other.own, strict=True))
        return OfSensors(parts, own, self.width + other.width, count=self.count)


def of_sensors(whitened: Sequence[tuple[White, IntArray]], width: int, count: int) -> OfSensors:
    """Columns of several sensors: of each those that are not zero, and which these are."""
    parts, own = zip(*whitened, strict=True)
    return OfSensors(parts, own, width, count=count)
