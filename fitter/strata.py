"""Covariance of coefficients where rows depend on each other: rising and falling series, replications, neighbours.

A least-squares fit takes its rows as independent. Three tests ask whether they are:

1. Rising against falling series: each with a curve of its own. A difference is a systematic one, so it is taken out of
   the scatter and given as `reversed` (ISO 376, reversibility).
2. Replications against scatter inside them: each with coefficients of its own, as Table 2 of NASA/TP-1999-209835 has
   it. If they differ, the variance of a result is that of the mean of n replications (JCGM 100, 4.2.3), with n - 1
   degrees of freedom. What rows of one replication have in common is in it, whatever it is. Where replications are not
   alike, or effects were fitted beside the model, variance and degrees of freedom are corrected by their moments
   (Bell and McCaffrey, Survey Methodology 28 (2002) 169).
3. Neighbours in time inside replications (Durbin and Watson, Biometrika 37, 1950). If they depend on each other, errors
   are taken as autoregressive of first order. The correlation, the variance and its degrees of freedom follow from
   exact moments of the residuals (Satterthwaite).

Without any, the scatter of all rows is pooled.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import special

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.linear import orthonormal
from rig.fitter.sums_of_squares import FTest, own_parameters, project_out

DIFFER = 0.05
"""Significance level for series and replications."""
WANDERS = 1e-3
"""Significance level for neighbours in time, whose distribution is taken as normal."""
TOO_GOOD = 1e-3
"""Probability of so small a ratio of mean squares by chance, below which it is said."""
_NEARLY = 0.95
_LARGEST, _STEPS = 0.995, 40
_NOTHING = FTest(float("nan"), 0, 0)


@dataclass(frozen=True, eq=False)
class Strata:
    """Series, replications and neighbours among the n rows of a fit with k coefficients.

    Attributes:
        variance: of one row, without the difference between rising and falling series.
        df: its degrees of freedom.
        replications: number of them.
        between: test of replications against the scatter inside them.
        correlation: of neighbours in time; 0 if it is not significant.
        sides: test of rising against falling series.
        reversed: (2, k) coefficients of the rising, and of the falling series, less those of the fit; None if they do
            not differ.
        covariance: (k, k) of the coefficients, if replications do not differ.
        moved: (k, n) change of the coefficients for one unit of each row.
        left: (n,) residuals.
        basis: (n, p) orthonormal, of all that was fitted.
        replicate: (n,) number of the replication.
    """

    variance: float
    df: float
    replications: int
    between: FTest
    correlation: float
    sides: FTest
    reversed: FloatArray | None
    covariance: FloatArray
    moved: FloatArray
    left: FloatArray
    basis: FloatArray
    replicate: IntArray

    @property
    def differ(self) -> bool:
        """Whether replications differ by more than the scatter inside them."""
        return bool(self.between.p < DIFFER)

    @property
    def too_good(self) -> float:
        """Probability that replications agree so well by chance; 1 if that is nothing to wonder at."""
        return chance_of_less(self.between)

    def of(self, J: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(m, m) covariance of results with (m, k) derivatives `J` by the coefficients, and its (m,) degrees of
        freedom.
        """
        if not self.differ:
            return np.asarray(J @ self.covariance @ J.T), np.full(len(J), self.df)
        rows = J @ self.moved
        each = [self.replicate == r for r in range(self.replications)]
        shifts = np.stack([rows[:, one] @ self.left[one] for one in each], axis=1)
        seen = np.stack([rows[:, one] @ self.basis[one] for one in each], axis=1)
        inner = -np.einsum("mrp,msp->mrs", seen, seen)
        for r, one in enumerate(each):
            inner[:, r, r] += np.sum(rows[:, one] ** 2, axis=1)
        trace, whole = np.einsum("mrr->m", inner), np.sum(rows**2, axis=1)
        known = trace > 1e-9 * whole
        scale = np.sqrt(np.where(known, whole / np.where(known, trace, 1.0), 1.0))
        df = np.where(known, trace**2 / np.maximum(np.einsum("mrs,mrs->m", inner, inner), 1e-300), 1.0)
        shifts = scale[:, None] * shifts
        full = self.replications - 1.0
        # a design that is not quite balanced has 1.99 of 2, which a certificate would cut to 1
        df = np.where(df > _NEARLY * full, full, df)
        return np.asarray(shifts @ shifts.T), np.maximum(df, 1.0)


def chance_of_less(test: FTest) -> float:
    """Probability of so small a ratio by chance, if it is below `TOO_GOOD`; 1 otherwise."""
    if not test.value >= 0.0 or test.df_above < 1 or test.df_below < 1:
        return 1.0
    p = float(special.fdtr(test.df_above, test.df_below, test.value))
    return p if p < TOO_GOOD else 1.0


def strata(
    columns: FloatArray,
    left: FloatArray,
    replicate: IntArray,
    side: FloatArray,
    beside: FloatArray | None = None,
    pure: tuple[float, float] | None = None,
    slopes: FloatArray | None = None,
) -> Strata:
    """The strata of rows in order of time.

    Args:
        columns: (n, k) of the fit, or its tangent.
        left: (n,) its residuals.
        replicate: (n,) number of the replication, from 0.
        side: (n,) +1 of a rising series, -1 of a falling one, 0 unknown or without series.
        beside: (n, q) what was fitted beside the model and taken off; None for nothing.
        slopes: (n, c) how the rows change with constants that were searched: coefficients are less certain by them, and
            they take nothing off the residuals.
        pure: variance of a row and its degrees of freedom, if they are known to be smaller than those of the residuals.
    """
    n, k = columns.shape
    every = columns if beside is None else np.column_stack([columns, beside])
    basis = orthonormal(every)
    left = project_out(left, basis)
    reverse, of_sides, left, basis = by_side(columns, basis, left, side)
    searched = np.zeros((n, 0)) if slopes is None else slopes
    df = n - basis.shape[1] - searched.shape[1]
    variance, variance_df = (float(left @ left) / max(df, 1), float(df)) if pure is None else pure
    own = own_parameters(columns, replicate)
    own = orthonormal(project_out(own, basis), np.linalg.norm(own, axis=0))
    above, rest = float(np.sum((own.T @ left) ** 2)), project_out(left, own)
    below = (float(rest @ rest), df - own.shape[1]) if pure is None else (variance * variance_df, int(variance_df))
    between = _NOTHING
    if own.shape[1] and below[1] > 0 and below[0] > 0.0:
        between = FTest(above / own.shape[1] / (below[0] / below[1]), own.shape[1], below[1])
    every = np.column_stack([every, searched])
    moved = np.linalg.pinv(every / (size := _sizes(every)))[:k] / size[:k, None]
    joined = np.where(replicate[1:] == replicate[:-1], 1.0, 0.0)
    r = 0.0 if pure is not None or between.p < DIFFER else _correlation(basis, left, joined)
    if r:
        first, second = _moments(basis, joined, r)
        variance, variance_df = float(left @ left) / first, first**2 / second
    covariance = variance * moved @ (_through(moved.T, joined, r) if r else moved.T)
    number = int(replicate.max()) + 1
    told = (variance, variance_df, number, between, r, of_sides, reverse, covariance)
    return Strata(*told, moved, left, basis, replicate)


def _sizes(columns: FloatArray) -> FloatArray:
    size = np.linalg.norm(columns, axis=0)
    return np.where(size > 0.0, size, 1.0)


def by_side(
    columns: FloatArray, basis: FloatArray, left: FloatArray, side: FloatArray, tests: int = 1
) -> tuple[FloatArray | None, FTest, FloatArray, FloatArray]:
    """Coefficients of both sides beside those of the fit, their test, residuals without them, the basis with them.

    Where a setting has more rows of one side, the fit is nearer to that side: it is not half-way between both.

    Args:
        columns: (n, k) of the fit.
        basis: (n, p) orthonormal, of all that was fitted.
        left: (n,) residuals.
        side: (n,) +1 of a rising series, -1 of a falling one, 0 unknown or without series.
        tests: number of such tests of one run, all of which together find a difference by chance in 5 % of runs.

    Returns:
        (2, k) coefficients of the rising, and of the falling series, less those of the fit, None if they do not
        differ; the test; (n,) residuals; (n, p + q) the basis.
    """
    nothing = (None, _NOTHING, left, basis)
    if not ((side > 0).any() and (side < 0).any()):
        return nothing
    half = side / 2.0
    halves = columns * half[:, None]
    own = orthonormal(project_out(halves, basis), np.linalg.norm(columns, axis=0))
    rest = project_out(left, own)
    below, df = float(rest @ rest), len(left) - basis.shape[1] - own.shape[1]
    if not own.shape[1] or df < 1 or below <= 0.0:
        return nothing
    test = FTest(float(np.sum((own.T @ left) ** 2)) / own.shape[1] / (below / df), own.shape[1], df)
    if not test.p * tests < DIFFER:
        return None, test, left, basis
    differs, size = reversed_by(columns, left, side, basis), _sizes(columns)
    away = np.linalg.lstsq(columns / size, halves @ differs, rcond=1e-9)[0] / size
    return sides_of(differs) - away, test, rest, np.column_stack([basis, own])


def sides_of(differs: FloatArray) -> FloatArray:
    """(2, k) coefficients of the rising, and of the falling series, less those half-way, of (k,) their difference."""
    return np.stack([differs, -differs]) / 2.0


def reversed_by(
    columns: FloatArray, values: FloatArray, side: FloatArray, basis: FloatArray | None = None
) -> FloatArray:
    """(k,) coefficients of the rising series less those of the falling ones, of (n,) values.

    Args:
        columns: (n, k) of the fit.
        values: (n,) residuals, or an effect of the direction.
        side: (n,) +1, -1 or 0.
        basis: (n, p) orthonormal, of all that was fitted; None for the columns alone.
    """
    basis = orthonormal(columns) if basis is None else basis
    size = _sizes(columns)
    beyond = project_out(columns / size * (side[:, None] / 2.0), basis)
    return np.asarray(np.linalg.lstsq(beyond, project_out(values, basis), rcond=1e-9)[0]) / size


def covariance_of_sides(columns: FloatArray, side: FloatArray, basis: FloatArray) -> FloatArray:
    """(k, k) covariance of half of what `reversed_by` gives, for values of variance 1; arguments as there."""
    size = _sizes(columns)
    moved = np.linalg.pinv(project_out(columns / size * side[:, None], basis), rcond=1e-9) / size[:, None]
    return np.asarray(moved @ moved.T)


def _neighbours(values: FloatArray, joined: FloatArray) -> FloatArray:
    """(n, q) means of both neighbours inside the replication, twice halved: x' of it sums products of neighbours."""
    out = np.zeros_like(values)
    out[:-1] += 0.5 * joined[:, None] * values[1:]
    out[1:] += 0.5 * joined[:, None] * values[:-1]
    return out


def _through(values: FloatArray, joined: FloatArray, r: float) -> FloatArray:
    """(n, q) R times the values: R has correlation r^d of rows d apart in one replication."""
    ahead, back = values.copy(), values.copy()
    for i in range(1, len(values)):
        ahead[i] += r * joined[i - 1] * ahead[i - 1]
    for i in range(len(values) - 2, -1, -1):
        back[i] += r * joined[i] * back[i + 1]
    return np.asarray(ahead + back - values)


def _correlation(basis: FloatArray, left: FloatArray, joined: FloatArray) -> float:
    """Correlation of neighbours in time, beyond that caused by the fit; 0 if it is not significant or negative."""
    n, rank = basis.shape
    df, norm = n - rank, float(left @ left)
    if df < 3 or norm <= 0.0:
        return 0.0
    found = float(np.sum(joined * left[1:] * left[:-1])) / norm
    near = _neighbours(basis, joined)
    inside = basis.T @ near
    mean = -float(np.trace(inside))
    square = 0.5 * float(joined.sum()) - 2.0 * float(np.sum(near**2)) + float(np.sum(inside**2))
    variance = 2.0 * (df * square - mean**2) / (df**2 * (df + 2.0))
    if variance <= 0.0 or float(special.ndtr((mean / df - found) / np.sqrt(variance))) >= WANDERS:
        return 0.0

    def expected(r: float) -> float:
        seen = _through(basis, joined, r)
        across = basis.T @ seen
        ahead = float(joined.sum()) * r - 2.0 * float(np.sum(near * seen)) + float(np.sum(across * inside))
        return float(ahead / (n - np.trace(across)))

    low, high = 0.0, _LARGEST
    for _ in range(_STEPS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if expected(middle) < found else (low, middle)
    return 0.5 * (low + high)


def _moments(basis: FloatArray, joined: FloatArray, r: float) -> tuple[float, float]:
    """Traces of M R and of its square, M the projection off the basis: mean of the sum of squared residuals over the
    variance, and half of its variance over the squared variance.
    """
    seen = _through(basis, joined, r)
    across = basis.T @ seen
    ends = np.flatnonzero(joined == 0.0) + 1
    squares = sum(_squares(len(part), r) for part in np.split(np.empty(len(joined) + 1), ends))
    second = squares - 2.0 * float(np.sum(seen**2)) + float(np.sum(across**2))
    return len(basis) - float(np.trace(across)), second


def _squares(m: int, r: float) -> float:
    """Sum of squares of the correlations of m rows."""
    apart = np.arange(1, m)
    return float(m + 2.0 * np.sum((m - apart) * np.power(r, 2.0 * apart)))
