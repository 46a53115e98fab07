"""Noise of rows with a common error of their group and correlated neighbours: a wander in addition to offsets.

Covariance of a wander (`noise.Wandering`) plus r Z Z', Z the groups. In rows whitened by the wander it is the identity
plus a matrix with the dimension of the number of groups, whose eigenvectors whiten the rest. It is used only for tables
with correlated neighbours within groups, because it needs several times the computing time of offsets alone.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Self

import numpy as np

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.trace.engine.noise import BoolArray, Wandering
from rig.fitter.trace.engine.shared import Shared
from rig.fitter.trace.engine.white import Along, ByComponents, White

RATIOS = (0.0, 0.1, 0.5, 2.0, 10.0, 100.0)
"""Variance of the common error of a group over the variance of a row in it."""
WANDERS = ((0.2, 1.0), (0.4, 1.0), (0.6, 1.0), (0.75, 1.0), (0.75, 0.4), (0.89, 0.7), (0.96, 0.4), (0.98, 0.7))
"""Correlation between neighbours of the wander, and its share of a row's variance; walks are added."""
STEPS = (0.03, 0.3)
_LEAST = 1e-9


@dataclass(frozen=True, eq=False)
class Both(Shared):
    """A wander in addition to offsets of groups; the first covariance is that of independent rows.

    Attributes:
        when: (n,) times of the rows in units of the usual gap, ascending.
        wander: its covariances, from which `of` selects.

    """

    when: FloatArray = field(kw_only=True)

    @cached_property
    def wander(self) -> Wandering:
        """The wander by itself, its whole grid."""
        return Wandering(self.when, sd=self.sd)

    @cached_property
    def _of(self) -> tuple[IntArray, FloatArray]:
        """(G,) index in the wander's grid, and ratio of the common error of groups."""
        grid = [0, *(self.wander.nearest(c, share) for c, share in WANDERS), *map(self.wander.walk, STEPS)]
        pairs = [(w, r * self.scale) for w in grid for r in RATIOS]
        wanted = pairs if self.picked is None else pairs[self.picked : self.picked + 1]
        return np.array([w for w, _ in wanted]), np.array([r for _, r in wanted])

    @cached_property
    def _ratio(self) -> FloatArray:
        return self._of[1]

    @cached_property
    def _bases(self) -> dict[int, tuple[FloatArray, FloatArray]]:
        """By wander: (n, q) orthonormal basis of the groups whitened by it, and (q,) their squared lengths."""
        groups = (self.group[:, None] == np.arange(int(self.group.max()) + 1)) * self._share[:, None]
        out = {}
        for w in np.unique(self._of[0]).tolist():
            u, s, _ = np.linalg.svd(self.wander.whiten(np.array([w]), groups)[0], full_matrices=False)
            kept = s > _LEAST * s.max()
            out[w] = (u[:, kept], s[kept] ** 2)
        return out

    @property
    def alone(self) -> BoolArray:
        """(G,) those without a wander."""
        return np.asarray(self._of[0] == 0)

    @property
    def prior(self) -> FloatArray:
        """See `Noise`: no wander counts as four."""
        return np.asarray(np.where(self.alone, 4.0, self.wander.prior[self._of[0]]))

    @property
    def correlation(self) -> FloatArray:
        """(G,) correlation of two neighbouring rows' errors of a group, its offset taken off; one for a walk."""
        return np.asarray(self.wander.correlation[self._of[0]])

    @property
    def slow(self) -> BoolArray:
        """See `Noise`."""
        return np.asarray(self.wander.slow[self._of[0]])

    @property
    def drifting(self) -> BoolArray:
        """See `Noise`."""
        return np.asarray(self.wander.drifting[self._of[0]])

    @property
    def memory(self) -> FloatArray:
        """See `Noise`: of the wander."""
        return np.asarray(self.wander.memory[self._of[0]])

    @cached_property
    def log_det(self) -> FloatArray:
        """See `Noise`."""
        more = [np.sum(np.log1p(r * self._bases[w][1])) for w, r in zip(*(v.tolist() for v in self._of), strict=True)]
        return np.asarray(self.wander.log_det[self._of[0]] + np.array(more))

    def whiten(self, which: IntArray, columns: FloatArray) -> FloatArray:
        """See `Noise`."""
        out = np.empty((len(which), *columns.shape))
        done: dict[int, FloatArray] = {}
        for i, g in enumerate(which.tolist()):
            w, r = int(self._of[0][g]), float(self._of[1][g])
            if w not in done:
                done[w] = self.wander.whiten(np.array([w]), columns)[0]
            basis, square = self._bases[w]
            out[i] = _stretched(done[w], basis, 1.0 / np.sqrt(1.0 + r * square)) if r > 0 else done[w]
        return out

    def white(self, which: IntArray, columns: FloatArray) -> White:
        """See `Noise`."""
        of, ratios = self._of[0][which], self._of[1][which]
        parts = []
        for w in np.unique(of).tolist():
            at = np.flatnonzero(of == w)
            rows, (basis, square) = self.wander.whiten(np.array([w]), columns)[0], self._bases[w]
            own = ratios[at, None] * square
            parts.append(Along(at, rows, (basis.T @ rows)[None], (own / (1.0 + own))[:, None]))
        return ByComponents(tuple(parts), len(which))

    def back(self, at: int, white: FloatArray) -> FloatArray:
        """See `Noise`."""
        w, r = int(self._of[0][at]), float(self._of[1][at])
        basis, square = self._bases[w]
        return self.wander.back(w, _stretched(white, basis, 1.0 / np.sqrt(1.0 + r * square)))

    def colour(self, at: int, white: FloatArray) -> FloatArray:
        """See `Noise`."""
        return self.wander.colour(int(self._of[0][at]), self._stretch(at, white))

    def root(self, at: int, columns: FloatArray) -> FloatArray:
        """See `Noise`."""
        return self._stretch(at, self.wander.root(int(self._of[0][at]), columns))

    def _stretch(self, at: int, columns: FloatArray) -> FloatArray:
        basis, square = self._bases[int(self._of[0][at])]
        return _stretched(columns, basis, np.sqrt(1.0 + float(self._of[1][at]) * square))

    def variances(self, at: int) -> FloatArray:
        """See `Noise`."""
        return np.asarray(self.wander.variances(int(self._of[0][at])) + self._of[1][at] * self._share**2)

    def rows(self, kept: IntArray) -> Self:
        """See `Noise`."""
        return replace(super().rows(kept), when=self.when[kept])


def _stretched(columns: FloatArray, basis: FloatArray, by: FloatArray) -> FloatArray:
    """(n, m) `columns` with their parts along an orthonormal basis (n, q) multiplied (q,)."""
    return np.asarray(columns + basis @ ((by - 1.0)[:, None] * (basis.T @ columns)))
