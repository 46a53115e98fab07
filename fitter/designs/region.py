"""The region of use of a model: its settings, its moments, and a basis in which terms are comparable."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import null_space, solve_triangular

from rig.fitter.arrays import FloatArray
from rig.fitter.designs.classical import grid
from rig.fitter.designs.factors import Factor, as_factors
from rig.fitter.errors import FitError

Columns = Callable[[FloatArray], FloatArray]
"""(n, p) model matrix of (n, k) points."""
Allowed = Callable[[FloatArray], NDArray[np.bool_]]
"""(n,) which of (n, k) points the bench may be set to."""

AT_MOST = 20_000
"""Largest number of points for means over the region and for the search of its largest variance."""
NODES = 8
"""Gauss-Legendre nodes of a factor: exact for polynomials of degree 15, models of degree 7."""
LARGEST_TABLE = 4_000_000
"""Largest number of combinations of levels times terms, 32 MB."""
FINEST = 41
DEPENDENT = 1e-9
"""Singular value, relative to the largest, below which columns of unit length count as dependent."""


@dataclass(frozen=True, eq=False)
class Region:
    """Factors, and the model over their ranges.

    Attributes:
        factors: k of them.
        columns: of the model.
        names: of its p terms.
        allowed: which points may be set; None if all.
    """

    factors: tuple[Factor, ...]
    columns: Columns
    names: tuple[str, ...]
    allowed: Allowed | None = None

    @classmethod
    def of(
        cls,
        factors: Sequence[Factor | ArrayLike],
        columns: Columns,
        names: Sequence[str] | None = None,
        allowed: Allowed | None = None,
    ) -> Region:
        """The region of these factors; terms without names are numbered.

        Raises:
            FitError: there is no factor, or names and columns differ in number.
        """
        made = as_factors(factors)
        if not made:
            raise FitError("a design needs a factor")
        p = np.asarray(columns(np.array([[f.low for f in made], [f.high for f in made]]))).shape[1]
        named = tuple(f"term {i + 1}" for i in range(p)) if names is None else tuple(names)
        if len(named) != p:
            raise FitError(f"{p} columns were given for {len(named)} names")
        return cls(made, columns, named, allowed)

    def rows(self, points: FloatArray) -> FloatArray:
        """(n, p) model matrix of points, in the basis."""
        return np.asarray(self._columns(points) @ self.basis)

    def raw(self, points: ArrayLike) -> FloatArray:
        """(n, p) model matrix of points, as given; checks their shape."""
        array = np.asarray(points, np.float64)
        if array.ndim != 2 or array.shape[1] != len(self.factors):
            raise FitError(f"points need {len(self.factors)} columns, one a factor; their shape is {array.shape}")
        return self._columns(array)

    def may(self, points: FloatArray) -> NDArray[np.bool_]:
        """(n,) whether points may be set."""
        if self.allowed is None:
            return np.ones(len(points), np.bool_)
        return np.asarray(self.allowed(points), np.bool_)

    @cached_property
    def candidates(self) -> FloatArray:
        """(C, k) all combinations of levels that may be set.

        Raises:
            FitError: there is none, or there are more than memory is for.
        """
        counts = [len(f.levels) for f in self.factors]
        if np.prod([float(c) for c in counts]) * len(self.names) > LARGEST_TABLE:
            raise FitError(
                f"{' x '.join(map(str, counts))} combinations of levels are too many to search; "
                "give the factors fewer levels"
            )
        points = grid([f.levels for f in self.factors])
        points = points[self.may(points)]
        if not len(points):
            raise FitError("no combination of the factors' levels is allowed")
        return points

    @cached_property
    def settings(self) -> FloatArray:
        """(N, k) points that cover the region, where the largest variance is looked for."""
        per_factor = max(3, min(FINEST, int(AT_MOST ** (1.0 / len(self.factors)))))
        while per_factor > 2:
            axes = [f.steps(per_factor) for f in self.factors]
            if np.prod([a.size for a in axes]) <= AT_MOST:
                break
            per_factor -= 1
        points = grid(axes)
        return points[self.may(points)]

    @cached_property
    def moments(self) -> FloatArray:
        """(p, p) mean of f f' over the region, in the basis; f are the terms at a point.

        Raises:
            FitError: the region is empty.
        """
        count = max(3, min(NODES, int(AT_MOST ** (1.0 / len(self.factors)))))
        per_factor = [f.nodes(count) for f in self.factors]
        points = grid([x for x, _ in per_factor])
        weights = np.prod(grid([w for _, w in per_factor]), axis=1) * self.may(points)
        if not weights.any():
            raise FitError("no point of the region is allowed")
        rows = self.rows(points)
        return np.asarray(rows.T @ (rows * (weights / weights.sum())[:, None]))

    @cached_property
    def mean_squares(self) -> FloatArray:
        """(p,) of the columns over the region, in the caller's units."""
        inverse = np.linalg.inv(self.basis)
        return np.asarray(np.sum(inverse * (self.moments @ inverse), axis=0))

    @cached_property
    def basis(self) -> FloatArray:
        """(p, p) upper triangle T, so that the columns X T are orthonormal over the candidates.

        The D-criterion is the same in every basis; in this one nothing is lost to rounding, whatever the units.

        Raises:
            FitError: the candidates do not determine the terms; the message names those.
        """
        rows = self._columns(self.candidates)
        lost = lost_directions(rows)
        if lost.shape[1]:
            size = np.linalg.norm(rows, axis=0)
            terms = ", ".join(named(lost, np.where(size > 0.0, size, 1.0), self.names))
            raise FitError(
                f"no design over these levels determines {terms}. Give a factor more levels, or leave out a term"
            )
        r = np.linalg.qr(rows / np.sqrt(len(rows)), mode="r")
        return np.asarray(solve_triangular(r, np.eye(len(r))))

    def _columns(self, points: FloatArray) -> FloatArray:
        rows = np.asarray(self.columns(points), np.float64)
        if rows.ndim != 2 or len(rows) != len(points):
            raise ValueError(f"{len(points)} points need as many rows of the model, not an array of {rows.shape}")
        bad = np.flatnonzero(~np.isfinite(rows).all(axis=1))
        if bad.size:
            at = ", ".join(f"{x:g}" for x in points[bad[0]])
            raise FitError(f"the model is not finite at the point ({at})")
        return rows


def lost_directions(rows: FloatArray) -> FloatArray:
    """(p, r) independent combinations of coefficients that (n, p) rows do not determine; columns may differ in unit."""
    if len(rows) > rows.shape[1]:
        rows = np.asarray(np.linalg.qr(rows, mode="r"))
    length = np.linalg.norm(rows, axis=0)
    length = np.where(length > 0.0, length, 1.0)
    return np.asarray(null_space(rows / length, rcond=DEPENDENT) / length[:, None])


def named(directions: FloatArray, size: FloatArray, names: Sequence[str]) -> tuple[str, ...]:
    """Names of the terms in (p, r) combinations of coefficients; `size` (p,) is that of the terms' columns."""
    weight = np.linalg.norm(directions * size[:, None], axis=1)
    return tuple(name for name, w in zip(names, weight, strict=True) if w > 1e-6 * weight.max(initial=0.0))
