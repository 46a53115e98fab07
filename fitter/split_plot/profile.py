"""The restricted likelihood of one variance ratio: one scalar search, for one response or for thousands at once.

    -2 log L = nu log(2 pi q / nu) + nu + sum log(1 + ratio xi) + log|X'X|,   q = rest + sum u^2 / (1 + ratio xi)

It may have several maxima. A fixed grid of ratios brackets them (between neighbours no term changes by more than a
factor of 1.73), each is polished by safeguarded Newton steps on the score, and the highest is taken; ratio zero
competes where the score there is not positive. Above the largest nu u^2 / (rest xi) the score is negative for certain.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from rig.fitter import ties
from rig.fitter.arrays import FloatArray, IntArray

GRID = np.concatenate([[0.0], np.geomspace(1e-3, 1e12, 64)])
"""Grid of ratios times the largest eigenvalue xi_1."""

X_GRID = np.log1p(GRID)

CLOSE = 1e-7
"""Size of a Newton step after which the error, of the size of its square, is rounding."""

MOST_STEPS = 100


@dataclass(frozen=True, eq=False)
class Profile:
    """Restricted likelihood as a function of the ratio.

    Attributes:
        xi: (r,) eigenvalues above zero, the largest first.
        df: nu = n - k.

    """

    xi: FloatArray
    df: int

    def maximise(self, squares: FloatArray, rest: float) -> float:
        """Ratio of the highest restricted likelihood.

        Args:
            squares: (r,) u^2.
            rest: sum of squares outside X and Z, above zero.

        """
        score = self._grid_scores(squares, rest)
        rises = score > 0.0
        ratios = [] if rises[0] else [0.0]
        falls = np.flatnonzero(rises & ~np.append(rises[1:], False)).tolist()
        ratios += [self._root(i, score[i : i + 2], squares, rest) for i in falls]
        if len(ratios) > 1:
            ratios.sort(key=lambda ratio: float(self.deviance(np.array(ratio), squares, np.array(rest))))
        return ratios[0]

    def maximise_many(self, squares: FloatArray, rest: FloatArray) -> FloatArray:
        """(m,) ratios for (r, m) `squares` and (m,) `rest`."""
        score = self._grid_scores(squares, rest)
        rises = score > 0.0
        interval, response = np.nonzero(rises & ~np.vstack([rises[1:], np.zeros_like(rises[:1])]))
        ends = np.stack([score[interval, response], score[np.minimum(interval + 1, len(GRID) - 1), response]])
        ratio = self._roots(interval, ends, squares[:, response], rest[response])
        at_zero = np.flatnonzero(~rises[0])
        ratio = np.concatenate([ratio, np.zeros(len(at_zero))])
        response = np.concatenate([response, at_zero])
        if len(response) > len(rest):
            worst_first = ties.descending(self.deviance(ratio, squares[:, response], rest[response]))
            ratio, response = ratio[worst_first], response[worst_first]
        best = np.empty(len(rest))
        best[response] = ratio  # of several maxima of a response the highest is last
        return best

    def deviance(self, ratio: FloatArray, squares: FloatArray, rest: FloatArray) -> FloatArray:
        """(m,) or () nu log(q / nu) + sum log(1 + ratio xi): -2 log L except for terms independent of the ratio."""
        grown = 1.0 + np.multiply.outer(self.xi, ratio)
        q = rest + np.sum(squares / grown, axis=0)
        return np.asarray(self.df * np.log(q / self.df) + np.sum(np.log(grown), axis=0))

    @cached_property
    def _ratios(self) -> FloatArray:
        return np.asarray(GRID / self.xi[0])

    @cached_property
    def _shrinkage(self) -> FloatArray:
        return np.asarray(1.0 / (1.0 + np.outer(self._ratios, self.xi)))

    @cached_property
    def _slopes(self) -> FloatArray:
        return np.asarray(self.df * self._per_x[:, None] * self.xi * self._shrinkage**2)

    @cached_property
    def _traces(self) -> FloatArray:
        return np.asarray(self._per_x * np.sum(self.xi * self._shrinkage, axis=1))

    @property
    def _per_x(self) -> FloatArray:
        return np.asarray((1.0 + GRID) / self.xi[0])

    def _grid_scores(self, squares: FloatArray, rest: FloatArray | float) -> FloatArray:
        """(grid,) or (grid, m) twice the derivative of log L by x."""
        traces = self._traces if squares.ndim == 1 else self._traces[:, None]
        return np.asarray(self._slopes @ squares / (rest + self._shrinkage @ squares) - traces)

    def _root(self, interval: int, ends: FloatArray, squares: FloatArray, rest: float) -> float:
        """Zero of the score in an `interval` of the grid, from positive to negative; `ends`: the scores at its ends.

        Newton steps in x = log(1 + ratio xi_1), with bisection for steps that would leave the bracket.
        """
        if interval + 1 < len(GRID):
            low, high = X_GRID[interval : interval + 2].tolist()
            x = low + (high - low) * float(ends[0] / (ends[0] - ends[1]))
        else:
            low, high = float(X_GRID[-1]), float(self._last_x(squares, rest))
            x = 0.5 * (low + high)
        for _ in range(MOST_STEPS):
            score, slope = self._score(x, self.xi, squares, rest)
            low, high = (x, high) if score > 0.0 else (low, x)
            x_next = x - score / slope if slope < 0.0 else np.inf
            if not low <= x_next <= high:
                x_next = 0.5 * (low + high)
            step, x = abs(x_next - x), x_next
            if step <= CLOSE:
                break
        return float(np.expm1(x) / self.xi[0])

    def _roots(self, interval: IntArray, ends: FloatArray, squares: FloatArray, rest: FloatArray) -> FloatArray:
        """(p,) the same for p intervals at once."""
        inner = interval + 1 < len(GRID)
        low = X_GRID[interval]
        high = np.where(inner, X_GRID[np.minimum(interval + 1, len(GRID) - 1)], self._last_x(squares, rest))
        x = low + (high - low) * np.where(inner, ends[0] / np.where(inner, ends[0] - ends[1], 1.0), 0.5)
        for _ in range(MOST_STEPS):
            score, slope = self._score(x, self.xi[:, None], squares, rest)
            low, high = np.where(score > 0.0, x, low), np.where(score > 0.0, high, x)
            x_next = x - score / np.where(slope < 0.0, slope, -1.0)
            x_next = np.where((slope < 0.0) & (low <= x_next) & (x_next <= high), x_next, 0.5 * (low + high))
            step, x = np.abs(x_next - x), x_next
            if np.all(step <= CLOSE):
                break
        return np.asarray(np.expm1(x) / self.xi[0])

    def _last_x(self, squares: FloatArray, rest: FloatArray | float) -> FloatArray:
        """Ratio beyond the end of the grid at which the score is certainly negative."""
        bound = self.df * self.xi[0] / self.xi[-1] * np.max(squares, axis=0) / rest
        return np.asarray(np.log1p(2.0 * np.maximum(bound, GRID[-1])))

    def _score(self, x: Any, xi: FloatArray, squares: FloatArray, rest: Any) -> tuple[Any, Any]:
        """Score, and its slope along x, both divided by d ratio/dx; for one x and r, or for p."""
        unit = 1.0 / float(self.xi[0])
        per_x = unit * np.exp(x)
        d = 1.0 / (1.0 + (per_x - unit) * xi)
        e = xi * d
        f = squares * d
        fe = f * e
        q = rest + np.add.reduce(f)
        drop = np.add.reduce(fe) / q
        score = self.df * drop - np.add.reduce(e)
        bend = self.df * (drop * drop - 2.0 * np.add.reduce(fe * e) / q) + np.add.reduce(e * e)
        return score, bend * per_x + score
