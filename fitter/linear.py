"""Linear least squares by orthogonal triangularisation.

Columns are scaled to unit length and [X y] is reduced to a triangle, block of rows by block of rows if need be.
The normal equations, which square the condition number, are never formed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import qr as pivoted_qr
from scipy.linalg.lapack import dtrtri

from fitter.arrays import FloatArray
from fitter.quantiles import t_limit

FEWEST = 32
"""Rows that rounding errors are reckoned from at least: columns come with some of their own."""


class RankError(ValueError):
    """The observations do not determine all coefficients; the message names those that cannot be told apart."""


@dataclass(frozen=True, eq=False)
class LinearFit:
    """Result of y = X c + e, e independent with one variance.

    Attributes:
        names: of the k columns.
        coefficients: (k,) in units of y per unit of the column.
        root: (k, k) with root @ root.T = (X'X)^-1.
        rss: residual sum of squares, in squared units of y.
        n: number of observations.

    """

    names: tuple[str, ...]
    coefficients: FloatArray
    root: FloatArray
    rss: float
    n: int

    @property
    def df(self) -> int:
        """Degrees of freedom left for error."""
        return self.n - len(self.names)

    @property
    def sigma(self) -> float:
        """Standard error of one observation, in units of y; NaN where nothing is left to estimate it from."""
        return float(np.sqrt(self.rss / self.df)) if self.df > 0 else float("nan")

    @cached_property
    def covariance(self) -> FloatArray:
        """(k, k) covariance of the coefficients."""
        return np.asarray(self.sigma**2 * self.root @ self.root.T)

    @property
    def stderr(self) -> FloatArray:
        """(k,) standard errors of the coefficients."""
        return np.asarray(self.sigma * np.linalg.norm(self.root, axis=1))

    def predict(self, columns: FloatArray) -> FloatArray:
        """(m,) predicted outputs for (m, k) `columns`."""
        return np.asarray(columns @ self.coefficients)

    def variance_function(self, columns: FloatArray) -> FloatArray:
        """(m,) h' (X'X)^-1 h: variance of a predicted output over sigma^2; leverage where h is a row of X."""
        return np.asarray(np.sum((columns @ self.root) ** 2, axis=1))

    def confidence(self, columns: FloatArray, level: float = 0.95) -> FloatArray:
        """(m,) half-width of the confidence interval of the predicted output (eq. 72), in units of y."""
        return np.asarray(t_limit(level, self.df) * self.sigma * np.sqrt(self.variance_function(columns)))

    def prediction(self, columns: FloatArray, level: float = 0.95, sigma_0: float | None = None) -> FloatArray:
        """(m,) half-width of the interval for one new measured output (eq. 73), in units of y.

        Args:
            columns: (m, k).
            level: probability that the new measurement falls inside.
            sigma_0: standard deviation of the new measurement; without it that of this fit.

        """
        ratio = 1.0 if sigma_0 is None else (sigma_0 / self.sigma) ** 2
        return np.asarray(t_limit(level, self.df) * self.sigma * np.sqrt(self.variance_function(columns) + ratio))


@dataclass(frozen=True, eq=False)
class Triangle:
    """All that n rows of [X y] say about the coefficients, in (k + 1, k + 1) numbers; grows by blocks of rows.

    Attributes:
        names: of the k columns.
        r: upper triangle of [X y], or None before the first row.
        n: rows taken in.

    """

    names: tuple[str, ...]
    r: FloatArray | None = None
    n: int = 0

    def add(self, columns: FloatArray, y: FloatArray) -> Triangle:
        """Take in a block of rows, (m, k) `columns` and (m,) `y`; gives the grown triangle."""
        block = np.column_stack([columns, y])
        if block.shape[1] != len(self.names) + 1:
            raise ValueError(f"{block.shape[1] - 1} columns were given for {len(self.names)} names")
        stacked = block if self.r is None else np.vstack([self.r, block])
        return Triangle(self.names, np.asarray(np.linalg.qr(stacked, mode="r")), self.n + block.shape[0])

    def solve(self, least: float = 0.0) -> LinearFit:
        """Least-squares coefficients of all rows so far.

        Args:
            least: root mean square up to which a column counts as zero, in its own unit. Scaling would otherwise
                make a column of rounding errors as good as any other.

        Raises:
            RankError: the rows do not determine every coefficient.

        """
        k = len(self.names)
        if self.r is None or self.n < k:
            raise RankError(f"{self.n} observations cannot determine {k} coefficients ({', '.join(self.names)})")
        r, qty, rest = self.r[:k, :k], self.r[:k, k], self.r[k:, k]
        length = np.linalg.norm(r, axis=0)
        empty = [name for name, own in zip(self.names, length, strict=True) if own <= least * np.sqrt(self.n)]
        if empty:
            raise RankError(f"these observations do not determine {', '.join(empty)}: zero at every point")
        scaled = r / length
        self._check_rank(scaled)
        inverse = np.triu(dtrtri(scaled)[0])
        return LinearFit(self.names, inverse @ qty / length, inverse / length[:, None], float(np.sum(rest**2)), self.n)

    def _check_rank(self, scaled: FloatArray) -> None:
        _, values, right = np.linalg.svd(scaled)
        undetermined = right[values <= max(self.n, FEWEST) * np.finfo(float).eps * values[0]]
        if not len(undetermined):
            return
        weights = np.linalg.norm(undetermined, axis=0)
        alike = [name for name, weight in zip(self.names, weights, strict=True) if weight > 1e-3]
        raise RankError(f"these observations cannot tell apart: {', '.join(alike)}")


def least_squares(columns: FloatArray, y: FloatArray, names: Sequence[str], least: float = 0.0) -> LinearFit:
    """Fit y = columns @ coefficients.

    Args:
        columns: (n, k).
        y: (n,).
        names: k names, used in results and messages.
        least: root mean square up to which a column counts as zero.

    Raises:
        RankError: the observations do not determine every coefficient.

    """
    return Triangle(tuple(names)).add(columns, y).solve(least)


def orthonormal(columns: FloatArray, length: FloatArray | None = None, tolerance: float = 1e-7) -> FloatArray:
    """(n, rank) orthonormal basis of what the columns span; columns that add nothing are dropped.

    Args:
        columns: (n, k).
        length: (k,) what each column is measured by; without it its own length. Where the columns are what is left
            of longer ones, give the lengths these had, or their rounding errors pass for columns.
        tolerance: a column whose part outside the others is shorter than this, relative to `length`, adds nothing.

    """
    length = np.linalg.norm(columns, axis=0) if length is None else length
    used = columns[:, length > 0] / length[length > 0]
    if used.shape[1] == 0:
        return used
    q, r, _ = pivoted_qr(used, mode="economic", pivoting=True, check_finite=False)
    return np.asarray(q[:, : int(np.sum(np.abs(np.diag(r)) > tolerance))])
