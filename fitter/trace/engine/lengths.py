"""Candidates beside the declared columns under one covariance, as far as a simulation of scores needs them.

Sums over rows are the same whether candidates are whitened or the simulated residuals are whitened back. So candidates
are whitened once for each covariance, a few columns at a time, and only their lengths are kept.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.linear import orthonormal
from rig.fitter.trace.engine.problem import Problem
from rig.fitter.trace.engine.row_sums import pairs, row_sums, stretches
from rig.fitter.trace.engine.score import CONSTANT, NOTHING_LEFT, Apart, in_turn

Single = NDArray[np.float32]
NARROW = 12
"""Most columns of an effect that is simulated together with others."""


@dataclass(frozen=True, eq=False)
class Lengths:
    """Whitened candidates of a problem.

    Attributes:
        basis: (n, k) orthonormal, of the declared columns.
        apart: columns of candidates of one or two, as `score.in_turn` has them.
        wide: bases (n, q) of candidates of three columns or more, by candidate.
        start: (J + 1,) first column of each candidate.
    """

    basis: FloatArray
    apart: Apart
    wide: Mapping[int, Single]
    start: IntArray

    @cached_property
    def rank(self) -> IntArray:
        """(J,) columns of each."""
        out = np.diff(np.concatenate([[0], np.cumsum(self.apart[1])])[self.start])
        for j, units in self.wide.items():
            out[j] = units.shape[1]
        return np.asarray(out, np.int64)

    def gains(self, along: Single, left: FloatArray | Single) -> Single:
        """(J, m) reduction of the sums of squares of whitened residuals (n, m) by each candidate.

        Args:
            along: (D, m) products of columns with these residuals; changed.
            left: the residuals.
        """
        squares, kept, one, two, slope = self.apart
        along[two] -= slope[:, None].astype(np.float32) * along[one]
        along *= np.sqrt(np.divide(1.0, squares, out=np.zeros_like(squares), where=kept))[:, None].astype(np.float32)
        np.square(along, out=along)
        out = along[self.start[:-1]]
        pairs = np.flatnonzero(np.diff(self.start) == 2)
        out[pairs] += along[self.start[pairs] + 1]
        for j, units in self.wide.items():
            out[j] = np.sum((units.T @ left.astype(np.float32, copy=False)) ** 2, axis=0)
        return out


@dataclass(frozen=True, eq=False)
class Simulated:
    """Candidates of a problem for simulations, under any of its covariances."""

    problem: Problem

    @cached_property
    def parts(self) -> tuple[Part, ...]:
        """Effects of few columns together, and every other one alone, those of fewest columns first."""
        named, width = self.problem.named, np.diff(self.problem.start)
        columns = {name: int(width[own].sum()) for name, own in named.items()}
        narrow = [named[name] for name in named if columns[name] <= NARROW]
        wide = [named[name] for name in sorted(named, key=lambda name: columns[name]) if columns[name] > NARROW]
        every = [np.sort(np.concatenate(narrow)), *wide] if narrow else wide
        return tuple(Part(terms, Simulated(self.problem.only(terms.tolist()))) for terms in every)

    def width(self, at: int) -> int:
        """Number of columns that can be judged under a covariance."""
        return sum(int(part.simulated.under(at).rank.sum()) for part in self.parts)

    @cached_property
    def held(self) -> dict[Any, Any]:
        """The draws of the latest simulation."""
        return {}

    @cached_property
    def _known(self) -> dict[int, Lengths]:
        return {}

    @cached_property
    def _declared(self) -> tuple[FloatArray, FloatArray]:
        """(n, k) orthonormal basis of the declared columns over each row's sd, and (k, D) candidates along it."""
        sd = self.problem.sd[:, None]
        basis = orthonormal(self.problem.declared / sd)
        return basis, (basis / sd).T @ self.problem.columns / self._size

    @cached_property
    def _size(self) -> FloatArray:
        """(D,) largest value of each candidate's column, over which it is taken: products are of single precision."""
        size = np.max(np.abs(self.problem.columns), axis=0)
        return np.where(size > 0.0, size, 1.0)

    @cached_property
    def columns(self) -> Single:
        """(n, D) all candidates, each over its size and each row's sd, with the declared columns removed."""
        return self._beside.astype(np.float32)

    @property
    def _beside(self) -> FloatArray:
        declared, along = self._declared
        out = self.problem.columns / self._size
        for rows in stretches(self.problem.n):
            out[rows] = out[rows] / self.problem.sd[rows, None] - declared[rows] @ along
        return out

    def under(self, at: int) -> Lengths:
        """Whitened by covariance `at`."""
        if at not in self._known:
            self._known[at] = self._whitened(at)
        return self._known[at]

    def _whitened(self, at: int) -> Lengths:
        problem, which = self.problem, np.array([at])
        start, width = problem.start, np.diff(problem.start)
        declared, along = self._declared
        white = problem.noise.whiten(which, declared)[0]
        basis, n = orthonormal(white), problem.n
        own = problem.noise.whiten(which, self._beside)[0]
        squares, total, products, across = row_sums(own, np.hstack([basis, white]), first := pairs(start))
        of_basis, of_declared = products[: basis.shape[1]], products[basis.shape[1] :]
        every = squares + np.einsum("ij,ij->j", along, 2.0 * of_declared + white.T @ white @ along)
        about = every - (total + white.sum(axis=0) @ along) ** 2 / n
        length = np.sqrt(np.maximum(about, CONSTANT * every))
        within = across - np.einsum("ij,ij->j", of_basis[:, first], of_basis[:, first + 1])
        apart = in_turn(squares - np.einsum("ij,ij->j", of_basis, of_basis), within, first, length)
        wide = {}
        for j in np.flatnonzero(width > 2).tolist():
            some = slice(int(start[j]), int(start[j + 1]))
            alone = own[:, some]
            for _ in range(2):
                alone = alone - basis @ (basis.T @ alone)
            wide[j] = orthonormal(alone, length[some], NOTHING_LEFT).astype(np.float32)
        return Lengths(basis, apart, wide, start)


@dataclass(frozen=True, eq=False)
class Part:
    """Some of the effects of a problem.

    Attributes:
        terms: (j,) their candidates.
        simulated: these alone.
    """

    terms: IntArray
    simulated: Simulated
