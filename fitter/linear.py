"""Linear least squares by orthogonal triangularisation.

Columns are scaled to unit length and [X y] is reduced to a triangle, in blocks of rows if necessary. The normal
equations, which square the condition number, are never formed. If columns are so nearly dependent that rounding would
still cost digits, the solution of all rows at once is refined (`rig.fitter.all_digits`); a solution from blocks is not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg.lapack import dgeqp3, dorgqr, dtrtri

from rig.fitter.all_digits import refine
from rig.fitter.arrays import FloatArray
from rig.fitter.errors import FitError
from rig.fitter.quantiles import t_limit

FEWEST = 32
"""Minimum number of rows assumed for rounding errors: columns have some of their own."""

CONDITION = 100.0
"""Condition number from which a solution is refined; below it a fitting model has eleven correct digits."""

AFFORDABLE = 2_000_000
"""Maximum product n k^2 for a refinement, about 0.3 s."""

_SPANNED = 1e-9
"""Part of a column outside others, below which it is a combination of them."""


class RankError(FitError):
    """The observations do not determine all coefficients; the message names the undetermined ones."""


@dataclass(frozen=True, eq=False)
class LinearFit:
    """Result of y = X c + e, e independent with one variance.

    Attributes:
        names: of the k columns.
        coefficients: (k,) in units of y per unit of the column.
        root: (k, k) with root @ root.T = (X'X)^-1.
        rss: residual sum of squares, in squared units of y.
        n: number of observations.
        condition: condition number of the columns, each scaled to unit length: the growth of relative rounding errors.
        beside: number of further fitted coefficients, not listed; they cost degrees of freedom.
    """

    names: tuple[str, ...]
    coefficients: FloatArray
    root: FloatArray
    rss: float
    n: int
    condition: float
    beside: int = 0

    @property
    def df(self) -> int:
        """Degrees of freedom left for error."""
        return self.n - len(self.names) - self.beside

    def first(self, count: int) -> LinearFit:
        """The first `count` coefficients, with the uncertainty due to the others fitted with them."""
        return replace(
            self,
            names=self.names[:count],
            coefficients=self.coefficients[:count],
            root=self.root[:count],
            beside=self.beside + len(self.names) - count,
        )

    @property
    def sigma(self) -> float:
        """Standard error of one observation, in units of y; NaN without degrees of freedom.

        It is `sigma_E` of tables of any kind; that of attitude runs is in `rig.fitter.replication.analyse`.
        """
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
        """(m,) h' (X'X)^-1 h: variance of a predicted output over sigma^2; leverage if h is a row of X."""
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
    """The information of n rows of [X y] about the coefficients, in (k + 1, k + 1) numbers; grows by blocks of rows.

    Several responses y share one triangle, which is then [X y_1 y_2 ...]; `of` returns the triangle of one response.

    Attributes:
        names: of the k columns.
        r: upper triangle of [X y], or None before the first row.
        n: number of rows.
    """

    names: tuple[str, ...]
    r: FloatArray | None = None
    n: int = 0

    def add(self, columns: FloatArray, y: FloatArray) -> Triangle:
        """Add a block of rows, (m, k) `columns` and (m,) or (m, q) `y`; returns the new triangle."""
        if columns.shape[1] != len(self.names):
            raise ValueError(f"{columns.shape[1]} columns were given for {len(self.names)} names")
        block = np.column_stack([columns, y])
        stacked = block if self.r is None else np.vstack([self.r, block])
        return Triangle(self.names, np.asarray(np.linalg.qr(stacked, mode="r")), self.n + block.shape[0])

    def of(self, response: int) -> Triangle:
        """The triangle of one of several responses."""
        if self.r is None:
            return self
        k = len(self.names)
        return replace(self, r=self.r[:, [*range(k), k + response]])

    def solve(self, least: float = 0.0) -> LinearFit:
        """Least-squares coefficients of all rows so far.

        Args:
            least: root mean square up to which a column counts as zero, in its own unit. Otherwise scaling would turn a
                column of rounding errors into a valid one.

        Raises:
            RankError: the rows do not determine every coefficient.
        """
        k = len(self.names)
        if self.r is None or self.n < k:
            raise RankError(f"{self.n} observations cannot determine {k} coefficients ({', '.join(self.names)})")
        r, qty, rest = self.r[:k, :k], self.r[:k, k], self.r[k:, k]
        length = np.linalg.norm(r, axis=0)
        short = length <= least * np.sqrt(self.n)
        if short.any():
            empty = [name for name, none in zip(self.names, short, strict=True) if none]
            raise RankError(f"these observations do not determine {', '.join(empty)}: zero at every point")
        scaled = r / length
        condition = self._condition(scaled)
        inverse = np.ascontiguousarray(dtrtri(scaled)[0])
        rss = float(rest @ rest)
        return LinearFit(self.names, inverse @ qty / length, inverse / length[:, None], rss, self.n, condition)

    def _condition(self, scaled: FloatArray) -> float:
        """Condition number, unless it is so large that the columns count as dependent."""
        values, least = np.linalg.svd(scaled, compute_uv=False), max(self.n, FEWEST) * np.finfo(float).eps
        if values[-1] > least * values[0]:
            return float(values[0] / values[-1])
        _, values, right = np.linalg.svd(scaled)
        undetermined = right[values <= least * values[0]]
        if not len(undetermined):
            return float(values[0] / values[-1])
        weights = np.linalg.norm(undetermined, axis=0)
        alike = [name for name, weight in zip(self.names, weights, strict=True) if weight > 1e-3]
        raise RankError(f"these observations cannot tell apart: {', '.join(alike)}")


def least_squares(
    columns: FloatArray, y: FloatArray, names: Sequence[str], least: float = 0.0, tails: FloatArray | None = None
) -> LinearFit:
    """Fit y = columns @ coefficients; refined from a condition number of `CONDITION` on, if that is `AFFORDABLE`.

    NIST's linear reference problems, including Filip's and Wampler's, have 13 correct digits.

    Args:
        columns: (n, k).
        y: (n,).
        names: k names, used in results and messages.
        least: root mean square up to which a column counts as zero.
        tails: (n, k) rounding errors of the doubles in `columns`, if known (`Formula.exact_columns`); used only by a
            refinement.

    Raises:
        RankError: the observations do not determine every coefficient.
    """
    fit = Triangle(tuple(names)).add(columns, y).solve(least)
    if fit.condition < CONDITION or columns.size * len(names) > AFFORDABLE:
        return fit
    found = refine(columns, tails, y, fit.root)
    if found is None:
        return fit
    coefficients, root, rss = found
    return replace(fit, coefficients=coefficients, root=root, rss=rss)


def spanned(v: FloatArray, basis: FloatArray) -> bool:
    """Whether (n,) v is a combination of the columns of an orthonormal basis (n, k): a model has it already."""
    return float(np.linalg.norm(v - basis @ (basis.T @ v))) <= _SPANNED * float(np.linalg.norm(v))


def orthonormal(
    columns: FloatArray, length: FloatArray | None = None, tolerance: float = 1e-7, *, overwrite: bool = False
) -> FloatArray:
    """(n, rank) orthonormal basis of the span of the columns; dependent columns are dropped.

    Args:
        columns: (n, k).
        length: (k,) reference length of each column; by default its own. For columns that are remainders of longer
            ones, give the original lengths; otherwise rounding errors count as columns.
        tolerance: a column whose part outside the others is shorter than this, relative to `length`, is dependent.
        overwrite: whether `columns` may be changed: of a million rows, a copy is as much memory as all else here.
    """
    length = np.linalg.norm(columns, axis=0) if length is None else length
    used = columns if np.all(length > 0) else columns[:, length > 0]
    if used.shape[1] == 0:
        return used
    used = np.array(used, np.float64, order="F", copy=None if overwrite else True)
    used /= length[length > 0]
    if used.shape[1] == 1:  # most calls, and the general way takes five times as long
        size = float(np.linalg.norm(used))
        return used / size if size > tolerance else used[:, :0]
    # as scipy.linalg.qr with pivoting does, whose preparations take as long as this for a few columns; a question for
    # the size of the work changes no array, but without `overwrite_a` it copies it
    work = int(dgeqp3(used, lwork=-1, overwrite_a=True)[3][0])
    reflected, _, tau, _, _ = dgeqp3(used, lwork=work, overwrite_a=True)
    rank = int(np.sum(np.abs(np.diag(reflected)) > tolerance))
    square = reflected[:, : min(used.shape)]
    work = int(dorgqr(square, tau, lwork=-1, overwrite_a=True)[1][0])
    return np.asarray(dorgqr(square, tau, lwork=work, overwrite_a=True)[0][:, :rank])
