"""Components of the error of rows in groups: an offset and a slope of each group, and memory within it.

The covariance of rows over their own standard deviations is A + Z K Z'. A has the memory of the rows of a group (of
first order, in the order of measurement), Z an indicator and a variable of each group, K the variances of offsets and
slopes. In rows whitened by A it is the identity plus a matrix of twice as many rows as there are groups, whose triangle
whitens the rest.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np
from scipy import special

from rig.fitter import ties
from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.trace.engine.noise import BoolArray
from rig.fitter.trace.engine.white import Along, ByComponents, White

OFFSETS = tuple(np.geomspace(0.05, 400.0, 20).tolist())
"""Variance of a group's offset over that of a row; far apart, effects between groups would be judged too well."""
SLOPES = (0.0, 0.1, 0.25, 0.6, 1.5, 4.0, 10.0, 30.0)
"""The same of its slope, for rows whose variable has a mean square of one."""
MEMORIES = (0.0, 0.3, 0.55, 0.8)
"""Correlation of a row's error with that of the row before in its group."""
PRICE = 1.0
"""In nats, of slopes and of memory: most tables have neither."""
LIKE = (1.7, 2.7)
"""Ratios of offsets and of slopes up to which two covariances give scores about the same distribution by chance."""
_LEAST = 1e-9


@dataclass(frozen=True, eq=False)
class Components:
    """Errors of rows in groups; the first covariance is that of independent rows.

    Attributes:
        group: (n,) group of each row, from zero.
        before: (n,) row of the row before in its group; the row itself at the first.
        variable: (n,) over which groups have slopes, about its mean in each.
        grid: (G, 3) variances of offsets and slopes over that of a row, and correlation of neighbouring rows.
        sd: (n,) standard deviation that each row was divided by.

    """

    group: IntArray
    before: IntArray
    variable: FloatArray
    grid: FloatArray
    sd: FloatArray

    @classmethod
    def of(cls, group: IntArray, order: IntArray, variable: FloatArray, scale: float = 1.0) -> Components:
        """All covariances of rows in groups.

        Args:
            group: (n,) of each row.
            order: (n,) executed position.
            variable: (n,) over which groups may have slopes.
            scale: factor of the variances of offsets.
        """
        size, about = spread_within(group, variable), about_means(group, variable)
        one = cls(group, _before(group, order), about / (size or 1.0), np.empty((0, 3)), np.ones(len(group)))
        return one.whole(scale)

    def whole(self, scale: float) -> Components:
        """With all covariances; `scale` is that of `of`."""
        own = list(product([0.0], SLOPES, MEMORIES))
        own += [(scale * o, s, m) for o, s, m in product(OFFSETS, SLOPES, MEMORIES)]
        if not np.any(self.variable):
            own = [one for one in own if one[1] == 0.0]
        return replace(self, grid=np.array(own))

    @property
    def of_group(self) -> IntArray:
        """(n,) group of each row."""
        return self.group

    @property
    def prior(self) -> FloatArray:
        """See `Noise`."""
        return np.ones(len(self.grid))

    @property
    def slow(self) -> BoolArray:
        """See `Noise`."""
        return np.zeros(len(self.grid), np.bool_)

    @property
    def drifting(self) -> BoolArray:
        """See `Noise`."""
        return np.zeros(len(self.grid), np.bool_)

    @property
    def memory(self) -> FloatArray:
        """See `Noise`."""
        return np.ones(len(self.grid))

    @cached_property
    def _memories(self) -> tuple[FloatArray, IntArray]:
        """Distinct memories, and which of them each covariance has."""
        values, which = np.unique(self.grid[:, 2], return_inverse=True)
        return values, which.astype(np.int64)

    @cached_property
    def _groups(self) -> FloatArray:
        """(n, 2 W) indicator and variable of each group, over each row's standard deviation."""
        member = (self.group[:, None] == np.arange(int(self.group.max()) + 1)) / self.sd[:, None]
        return np.hstack([member, member * self.variable[:, None]])

    @cached_property
    def _bases(self) -> tuple[tuple[FloatArray, FloatArray], ...]:
        """For each memory (n, q) an orthonormal basis of the groups whitened by it, and (q, 2 W) these in it."""
        out = []
        for white in self._whitened_groups:
            u, s, v = np.linalg.svd(white, full_matrices=False)
            kept = s > _LEAST * s[0]
            out.append((u[:, kept], s[kept, None] * v[kept]))
        return tuple(out)

    def _triangle(self, at: int) -> FloatArray:
        """(q, q) of a covariance, in the basis of its memory."""
        if at not in self._known:
            (offset, slope, _), own = self.grid[at].tolist(), self._bases[int(self._memories[1][at])][1]
            one, other = np.split(own, 2, axis=1)
            self._known[at] = np.linalg.cholesky(np.eye(len(own)) + offset * one @ one.T + slope * other @ other.T)
        return self._known[at]

    @cached_property
    def _known(self) -> dict[int, FloatArray]:
        return {}

    def _inverse(self, at: int) -> FloatArray:
        """(q, q) inverse of a triangle, less the identity."""
        if at not in self._known_inverses:
            triangle = self._triangle(at)
            self._known_inverses[at] = np.linalg.inv(triangle) - np.eye(len(triangle))
        return self._known_inverses[at]

    @cached_property
    def _known_inverses(self) -> dict[int, FloatArray]:
        return {}

    @cached_property
    def _whitened_groups(self) -> tuple[FloatArray, ...]:
        """For each memory (n, 2 W) the groups whitened by it: those of different groups have no row in common."""
        return tuple(self._less(rho, self._groups) for rho in self._memories[0].tolist())

    @cached_property
    def _determinants(self) -> tuple[FloatArray, FloatArray]:
        """(G, W) determinant of each group's covariance along its offset and slope, and (G, 3, W) weights of products
        of offsets, of both, and of slopes, in that covariance's inverse.
        """
        count = int(self.group.max()) + 1
        squares = np.empty((len(self._memories[0]), 3, count))
        for m, own in enumerate(self._whitened_groups):
            one, other = own[:, :count], own[:, count:]
            squares[m] = [np.einsum("nw,nw->w", *pair) for pair in ((one, one), (one, other), (other, other))]
        zz, zs, ss = squares[self._memories[1]].swapaxes(0, 1)
        offset, slope = self.grid[:, :1], self.grid[:, 1:2]
        determinant = (1.0 + offset * zz) * (1.0 + slope * ss) - offset * slope * zs**2
        weight = np.stack([offset * (1.0 + slope * ss), -offset * slope * zs, slope * (1.0 + offset * zz)], axis=1)
        return determinant, weight / determinant[:, None]

    @property
    def prices(self) -> FloatArray:
        """(G,) of slopes and of memory, as they are in `log_det`."""
        some = np.count_nonzero(self.grid[:, 1:] > 0.0, axis=1)
        return np.asarray(2.0 * PRICE * some)

    @cached_property
    def log_det(self) -> FloatArray:
        """See `Noise`; with the prices of its components."""
        followers = int(np.count_nonzero(self.before != np.arange(len(self.group))))
        of_rows = followers * np.log1p(-(self.grid[:, 2] ** 2))
        return np.asarray(self.prices + of_rows + np.sum(np.log(self._determinants[0]), axis=1))

    def white(self, which: IntArray, columns: FloatArray) -> White:
        """See `Noise`."""
        of, parts = self._memories[1][which], []
        for m in np.unique(of).tolist():
            at = np.flatnonzero(of == m)
            rows = self._less(float(self._memories[0][m]), columns)
            sums = np.stack(np.split(self._whitened_groups[m].T @ rows, 2))
            parts.append(Along(at, rows, sums, self._determinants[1][which[at]]))
        return ByComponents(tuple(parts), len(which))

    def whiten(self, which: IntArray, columns: FloatArray) -> FloatArray:
        """See `Noise`."""
        out = np.empty((len(which), *columns.shape))
        done: dict[int, tuple[FloatArray, FloatArray]] = {}
        for i, g in enumerate(which.tolist()):
            m = int(self._memories[1][g])
            if m not in done:
                white = self._less(float(self._memories[0][m]), columns)
                done[m] = white, self._bases[m][0].T @ white
            white, along = done[m]
            np.matmul(self._bases[m][0], self._inverse(g) @ along, out=out[i])
            out[i] += white
        return out

    def back(self, at: int, white: FloatArray) -> FloatArray:
        """See `Noise`."""
        m = int(self._memories[1][at])
        basis = self._bases[m][0]
        return self._later(float(self._memories[0][m]), white + basis @ (self._inverse(at).T @ (basis.T @ white)))

    def colour(self, at: int, white: FloatArray) -> FloatArray:
        """See `Noise`."""
        m = int(self._memories[1][at])
        return self._more(float(self._memories[0][m]), self._stretched(at, m, white, transposed=False))

    def root(self, at: int, columns: FloatArray) -> FloatArray:
        """See `Noise`."""
        m = int(self._memories[1][at])
        return self._stretched(
            at, m, self._more(float(self._memories[0][m]), columns, transposed=True), transposed=True
        )

    def _stretched(self, at: int, m: int, columns: FloatArray, *, transposed: bool) -> FloatArray:
        basis, triangle = self._bases[m][0], self._triangle(at)
        along = basis.T @ columns
        turned = (triangle.T if transposed else triangle) @ along
        out: FloatArray = columns + basis @ (turned - along)
        return out

    def variances(self, at: int) -> FloatArray:
        """See `Noise`."""
        offset, slope, _ = self.grid[at].tolist()
        return np.asarray(1.0 + (offset + slope * self.variable**2) / self.sd**2)

    def likeliest(self, reml: FloatArray, component: int) -> tuple[float, float]:
        """The likeliest variance of slopes (1) or correlation within groups (2), and p of it where there is none.

        Half of chi squared with one degree of freedom: a variance is on its bound (Self and Liang, JASA 82 (1987) 605).

        Args:
            reml: (G,) restricted log-likelihoods.
            component: column of the grid.
        """
        likely, none = reml + 0.5 * self.prices, self.grid[:, component] == 0.0
        gained = max(float(likely.max() - likely[none].max()), 0.0)
        return float(self.grid[ties.highest(likely), component]), 0.5 * float(special.chdtrc(1, 2.0 * gained))

    def rows(self, kept: IntArray) -> Components:
        """See `Noise`. A row whose row before is not kept follows the one before that."""
        group = np.asarray(np.unique(self.group[kept], return_inverse=True)[1], np.int64)
        number = np.full(len(self.group), -1)
        number[kept] = np.arange(len(kept))
        before = self.before[kept]
        while np.any(lost := number[before] < 0):
            behind = self.before[before]
            before = np.where(lost, np.where(behind == before, kept, behind), before)
        return Components(group, number[before], self.variable[kept], self.grid, self.sd[kept])

    def only(self, at: int) -> Components:
        """See `Noise`."""
        return replace(self, grid=self.grid[at : at + 1])

    def like(self, at: int, known: Sequence[int]) -> int:
        """A covariance among the `known` ones that is nearly this one; this one itself if there is none."""
        own = self.grid[at]
        for other in known:
            one = self.grid[other]
            ratio = np.maximum(own[:2], one[:2]) <= np.array(LIKE) * np.minimum(own[:2], one[:2])
            if np.all(ratio) and own[2] == one[2]:
                return other
        return at

    def among(self, kept: BoolArray) -> Components:
        """A grid of some of the covariances."""
        return replace(self, grid=self.grid[kept])

    def stretched(self, factor: float) -> Components:
        """The same with other variances of offsets."""
        return replace(self, grid=self.grid * np.array([factor, 1.0, 1.0]))

    def over(self, sd: FloatArray) -> Components:
        """See `Noise`."""
        return replace(self, sd=sd)

    def _less(self, rho: float, columns: FloatArray) -> FloatArray:
        """(n, m) columns without what their row before foretells, over the standard deviation of that."""
        if rho == 0.0:
            return columns
        first = (self.before == np.arange(len(self.before)))[:, None]
        return np.where(first, columns, (columns - rho * columns[self.before]) / np.sqrt(1.0 - rho**2))

    def _later(self, rho: float, white: FloatArray) -> FloatArray:
        """The transposed of `_less`."""
        if rho == 0.0:
            return white
        own = np.where(self._first, 1.0, 1.0 / np.sqrt(1.0 - rho**2))[:, None] * white
        out = own.copy()
        follows = np.flatnonzero(~self._first)
        np.subtract.at(out, self.before[follows], rho * own[follows])
        return out

    def _more(self, rho: float, white: FloatArray, *, transposed: bool = False) -> FloatArray:
        """The inverse of `_less`, or its transposed."""
        if rho == 0.0:
            return white
        out, step = white.copy(), np.sqrt(1.0 - rho**2)
        for rows in reversed(self._in_turn) if transposed else self._in_turn:
            back = self.before[rows]
            if transposed:
                out[back] += rho * out[rows]  # rows of one position follow different ones
                out[rows] *= step
            else:
                out[rows] = step * out[rows] + rho * out[back]
        return out

    @cached_property
    def _first(self) -> BoolArray:
        return np.asarray(self.before == np.arange(len(self.before)))

    @cached_property
    def _in_turn(self) -> list[IntArray]:
        """Second rows of all groups, third ones, and so on."""
        position, behind = np.zeros(len(self.before), np.int64), self.before
        moved = ~self._first
        while np.any(moved):
            position += moved
            moved = moved & (self.before[behind] != behind)
            behind = self.before[behind]
        return [np.flatnonzero(position == k) for k in range(1, int(position.max()) + 1)]


def spread_within(group: IntArray, variable: FloatArray) -> float:
    """Root mean square of a variable (n,) about its mean in each group: the unit of the variances of slopes."""
    return float(np.sqrt(np.mean(about_means(group, variable) ** 2)))


def about_means(group: IntArray, variable: FloatArray) -> FloatArray:
    """(n,) a variable less its mean in each group."""
    return variable - (np.bincount(group, variable) / np.bincount(group))[group]


def _before(group: IntArray, order: IntArray) -> IntArray:
    """(n,) row of the row before in its group; the row itself at the first."""
    executed = np.lexsort((order, group))
    behind = np.concatenate([executed[:1], executed[:-1]])
    behind = np.where(group[behind] == group[executed], behind, executed)
    return np.asarray(behind[np.argsort(executed)], np.int64)
