"""Analysis of variance of a replicated calibration: sigma_E, sigma_bias, sigma_prec and T_bias of NASA/TP-1999-209835.

With n replications of K points and L parameters (balanced; every count below is exact for missing points too):

    point by replication, "pure error"      SS_pe   K (n - 1)
    between points, lack of fit             SS_lof  K - L
    replications' own parameters            SS_rep  (n - 1) L      part of SS_pe
    pure error beyond them                  SS_pr   (n - 1)(K - L) the rest of SS_pe

The paper's T_b and T_S have lack of fit in their denominator, so removing a real effect can raise them; the joint
drift test is against SS_pr, which lack of fit does not enter.

T_bias has the scatter of readings at one point as its denominator. Drift between replications and wander within them
are in that scatter too, so a lack of fit smaller than they are is not significant: the test is blind to it. Drift of
the parameters between replications can be taken out: lack of fit is then tested against SS_pr. Wander within
replications cannot; it shows as correlation of neighbours in time.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import special

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.linear import CONDITION, LinearFit, RankError, Triangle, least_squares
from rig.fitter.own_span import NO_GROUP, Levels, OwnSpan, WithMore
from rig.fitter.sums_of_squares import NAN, FTest, project_out, ratio, within_points

_DRIFTS = 0.05
_WANDERS = 1e-3
_INFLATED = 1.1
"""Inflation below which drift hides no more than scatter does."""
AT_ONCE = 500_000
"""Numbers of a matrix of columns that are worked on at once, so that a million rows need little memory."""


@dataclass(frozen=True)
class Blind:
    """Why a lack of fit may not be significant.

    Attributes:
        inflation: mean square of readings at one point over that beyond each replication's own parameters; 1 where
            the parameters do not drift between replications.
        bias: lack of fit against the latter, beside the replications' own parameters.
        wander: correlation of neighbours in time of their residuals; 0 where it is not significant.

    """

    inflation: float
    bias: FTest
    wander: float

    @property
    def lacks_fit(self) -> bool:
        """Whether lack of fit is significant with drift between replications removed from the denominator."""
        return bool(self.bias.value > self.bias.limit_95)

    @property
    def sentence(self) -> str:
        """A sentence for people."""
        texts = []
        if self.inflation > 1.0:
            test = f"F {self.bias.value:.3g}, 95 % limit {self.bias.limit_95:.3g}"
            texts.append(
                f"T_bias can miss a lack of fit here: drift between replications makes its denominator "
                f"{self.inflation:.2g} times as large; against the scatter without that drift, lack of fit is "
                f"{'SIGNIFICANT' if self.lacks_fit else 'not significant'} ({test})"
            )
        if self.wander > 0.0:
            which = "that test" if texts else "T_bias"
            texts.append(
                f"{which} cannot see a lack of fit smaller than the wander within replications, which is in its "
                f"denominator (readings next to each other in time correlate by {self.wander:.2f})"
            )
        return "; ".join(texts)


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows of a replicated run with their model, and what Table 2 of any of its outputs needs of them.

    Attributes:
        columns: (n, L) rows of the declared model.
        point: (n,) point of the design, from 0.
        replicate: (n,) replication, from 0.
        order: (n,) order of measurement; None if it is that of the rows.
        extra: (n, q) columns of effects whose coefficients were fitted together with the model.
        plain: the same without `extra`, if known.
    """

    columns: FloatArray
    point: IntArray
    replicate: IntArray
    order: IntArray | None = None
    extra: FloatArray | None = None
    plain: Rows | None = None

    def beside(self, extra: FloatArray) -> Rows:
        """These rows with columns of effects; these rows if there are none."""
        return replace(self, extra=extra, plain=self) if extra.shape[1] else self

    @cached_property
    def n_points(self) -> int:
        """Number of points of the design."""
        return int(self.point.max()) + 1

    @cached_property
    def levels(self) -> Levels:
        """The points, each with a level of its own."""
        return Levels(self.point)

    @cached_property
    def effects(self) -> FloatArray:
        """(n, rank) orthonormal basis of the effects within points."""
        return within_points(np.empty((len(self.point), 0)) if self.extra is None else self.extra, self.point)

    @cached_property
    def both(self) -> OwnSpan | WithMore:
        """Span of the effects and the replications' own parameters within points."""
        if self.extra is None:
            return OwnSpan(self.columns, self.replicate, self.levels)
        own = (self.plain or replace(self, extra=None)).both
        assert isinstance(own, OwnSpan)
        return WithMore.of(own, self.extra)

    def every(self) -> OwnSpan | WithMore:
        """Span of the effects and the replications' own parameters; the points' means stay in."""
        own = OwnSpan(self.columns, self.replicate, Levels(np.broadcast_to(NO_GROUP, len(self.point))))
        return own if self.extra is None else WithMore.of(own, self.extra)

    @cached_property
    def time(self) -> IntArray | slice:
        """The rows in the order of measurement; a slice, which copies nothing, where that is their own."""
        ahead = self.order is None or not np.any(np.diff(self.order) < 0)
        return slice(None) if ahead or self.order is None else np.argsort(self.order)

    @cached_property
    def joined(self) -> FloatArray:
        """(n - 1,) half of one where a row and the next in time are of one replication."""
        replicate = self.replicate[self.time]
        return np.where(replicate[1:] == replicate[:-1], 0.5, 0.0)

    @cached_property
    def neighbours(self) -> tuple[float, float]:
        """Traces, of white noise seen through the fit, of the matrix that sums products of neighbours in time, and of
        its square.
        """
        of, joined, size = self.point[self.time], self.joined, np.bincount(self.point)
        scale = 1.0 / np.sqrt(size[of])
        # A row is at one point, so most of the projection is sparse: a few numbers a row, not one for each point. A row
        # of the product of neighbours and points has a number at the point of the next row, and of the one before.
        next_, last = joined * scale[1:], joined * scale[:-1]
        same = of[2:] == of[:-2]
        lagged = _squares(next_) + _squares(last) + 2.0 * float(next_[1:][same] @ last[:-1][same])
        pairs = np.minimum(of[1:], of[:-1]) * len(size) + np.maximum(of[1:], of[:-1])
        codes, which = np.unique(pairs, return_inverse=True)
        of_points = np.asarray(np.bincount(which, next_ * scale[:-1]), np.float64)
        alike = codes // len(size) == codes % len(size)
        trace, inner = (
            -2.0 * float(of_points[alike].sum()),
            2.0 * _squares(of_points) + 2.0 * _squares(of_points[alike]),
        )
        del next_, last, same, pairs, codes, which
        both, step = self.both, max(AT_ONCE // len(of), 1)
        for first in range(0, both.rank, step):
            within = both.expand(np.eye(both.rank)[:, first : first + step])[self.time]
            between = np.zeros(within.shape)
            between[:-1] = joined[:, None] * within[1:]
            between[1:] += joined[:, None] * within[:-1]
            lagged += _squares(between)
            for column in between.T:
                inner += 2.0 * _squares(np.asarray(np.bincount(of, scale * column), np.float64))
            if isinstance(self.time, slice):
                back = between
            else:
                back = np.empty(within.shape)
                back[self.time] = between
            of_within = both.coordinates(back)
            trace -= float(np.trace(of_within[first : first + step]))
            inner += _squares(of_within)
        return trace, 2.0 * _squares(joined) - 2.0 * lagged + inner


def blind(rows: Rows, output: FloatArray, left: FloatArray, drift: FTest, pure_error: float) -> Blind | None:
    """Reasons why the test of lack of fit can miss one; None if there are none.

    Args:
        rows: of the run.
        output: (n,) outputs, volts.
        left: (n,) their residuals beyond the points' means and replications' own parameters.
        drift: the joint test of drift between replications.
        pure_error: mean square of readings at one point.
    """
    rest = float(left @ left)
    if drift.df_below <= 0 or rest <= 0.0:
        return None
    inflation = pure_error * drift.df_below / rest
    drifts = bool(drift.p < _DRIFTS) and inflation >= _INFLATED
    wander, p = _wander(rows, left[rows.time], drift.df_below)
    if not drifts and p >= _WANDERS:
        return None
    bias = FTest(NAN, 0, drift.df_below)
    if drifts:
        every = rows.every()
        beyond = _squares(every.project_out(output))
        bias = ratio(beyond - rest, len(output) - every.rank - drift.df_below, rest, drift.df_below)
    return Blind(inflation if drifts else 1.0, bias, wander if p < _WANDERS else 0.0)


def _wander(rows: Rows, left: FloatArray, df: int) -> tuple[float, float]:
    """Correlation of neighbours in time beyond that caused by the fit, and its one-sided probability.

    Its mean and variance for white noise seen through the projection are exact (Durbin and Watson, Biometrika 37,
    1950); its distribution is taken as normal.

    Args:
        rows: of the run.
        left: (n,) residuals, in order of time.
        df: their degrees of freedom.
    """
    trace, square = rows.neighbours
    variance = 2.0 * (df * square - trace**2) / (df**2 * (df + 2.0))
    if variance <= 0.0:
        return 0.0, 1.0
    found = 2.0 * float(np.sum(rows.joined * left[1:] * left[:-1])) / float(left @ left) - trace / df
    return found, float(special.ndtr(-found / np.sqrt(variance)))


def _squares(values: FloatArray) -> float:
    return float(np.sum(values**2))


@dataclass(frozen=True)
class Replication:
    """Table 2 for one sensor; sigmas in volts.

    Attributes:
        sigma_E: standard error of the regression.
        sigma_bias: its part from lack of fit; sigma_bias^2 + sigma_prec^2 = sigma_E^2.
        sigma_prec: its part from scatter between replications at one point.
        bias: T_bias and its limit, on (K - L, K (n - 1)) degrees of freedom.
        sigma_b: variation of the offset between replications, scaled to sigma_w in the absence of drift.
        sigma_S: the same for the sensitivity.
        sigma_w: standard error of the fits to one replication each, pooled.
        sigma_pr: point by replication, beyond each replication's own parameters.
        drift_b: T_b and its limit, on (n - 1, n (K - L)) degrees of freedom.
        drift_S: T_S and its limit.
        drift: joint test of all parameters against sigma_pr.
        n_replications: number of replications that could be fitted separately.
        n_points: number of points of the design measured at least once.
        blind: reasons why `bias` can miss a lack of fit; None if it is significant or there are none.
    """

    sigma_E: float
    sigma_bias: float
    sigma_prec: float
    bias: FTest
    sigma_b: float
    sigma_S: float
    sigma_w: float
    sigma_pr: float
    drift_b: FTest
    drift_S: FTest
    drift: FTest
    n_replications: int
    n_points: int
    blind: Blind | None = None


def analyse(fit: LinearFit, rows: Rows, output: FloatArray, beside: int = 0) -> Replication:
    """Table 2 for one output.

    Args:
        fit: of `output` on the model's columns; offset first, sensitive axis in the remaining coefficients.
        rows: of the run.
        output: (n,) volts, already free of the effects beside the model.
        beside: number of fitted coefficients beyond those of the model; they cost degrees of freedom.
    """
    n, k = rows.columns.shape
    pe, df_pe, left, df_pr = _scatter(rows, output)
    ss_pr = _squares(left)
    df_lof = n - k - beside - df_pe
    lof = max(fit.rss - pe, 0.0)
    whole = sigma_E(fit, beside)
    split = pe / fit.rss if fit.rss > 0 else NAN
    alone = _each_alone(rows.columns, output, rows.replicate, fit.names)
    df_w, ss_w = sum(f.df for f in alone), sum(f.rss for f in alone)
    offset, sensitivity = np.eye(k)[0], np.array([0.0, *fit.coefficients[1:]])
    coefficients, roots = np.array([f.coefficients for f in alone]), np.array([f.root for f in alone])
    sigma_b, drift_b = _drift(coefficients, roots, offset, ss_w, df_w)
    sigma_S, drift_S = _drift(coefficients, roots, sensitivity, ss_w, df_w)
    drift = ratio(pe - ss_pr, df_pe - df_pr, ss_pr, df_pr)
    bias = ratio(lof, df_lof, pe, df_pe)
    hidden = blind(rows, output, left, drift, pe / df_pe) if df_pe > 0 and bias.value <= bias.limit_95 else None
    return Replication(
        sigma_E=whole,
        sigma_bias=whole * float(np.sqrt(1.0 - min(split, 1.0))) if df_pe > 0 else NAN,
        sigma_prec=whole * float(np.sqrt(min(split, 1.0))) if df_pe > 0 else NAN,
        bias=bias,
        sigma_b=sigma_b,
        sigma_S=sigma_S,
        sigma_w=float(np.sqrt(ss_w / df_w)) if df_w > 0 else NAN,
        sigma_pr=float(np.sqrt(ss_pr / df_pr)) if df_pr > 0 else NAN,
        drift_b=drift_b,
        drift_S=drift_S,
        drift=drift,
        n_replications=len(alone),
        n_points=rows.n_points,
        blind=hidden,
    )


def sigma_E(fit: LinearFit, beside: int = 0) -> float:  # noqa: N802 - the paper's name
    """Standard error of the regression of `analyse`, in the unit of the output; NaN without degrees of freedom."""
    df = fit.n - len(fit.names) - beside
    return float(np.sqrt(fit.rss / df)) if df > 0 else NAN


def drift_of(rows: Rows, output: FloatArray) -> FTest:
    """The joint drift test of `analyse` alone."""
    pe, df_pe, left, df_pr = _scatter(rows, output)
    pr = _squares(left)
    return ratio(pe - pr, df_pe - df_pr, pr, df_pr)


def _scatter(rows: Rows, output: FloatArray) -> tuple[float, int, FloatArray, int]:
    """Sum of squares within points and its degrees of freedom; (n,) residuals beyond replications' own parameters and
    theirs.
    """
    y, n = rows.levels.project_out(output), len(output) - rows.n_points
    return (
        _squares(project_out(y, rows.effects)),
        n - rows.effects.shape[1],
        rows.both.project_out(y),
        n - rows.both.rank,
    )


def between_replications(
    columns: FloatArray, output: FloatArray, replicate: IntArray, fit: LinearFit
) -> tuple[FloatArray, int] | None:
    """Covariance of the coefficients from separate fits of the replications, and its degrees of freedom. That of the
    pooled fit assumes independent readings. It is too small if offset or sensitivity drift between replications, and
    too large if a lack of fit repeats in each. The mean square between replications, on n - 1 degrees of freedom, is
    the variance of their mean, for any source of variation. Replications are weighted by their information about the
    coefficients, so an incomplete one counts less.

    Args:
        columns: (n, L) rows of the declared model.
        output: (n,) volts, without other fitted effects.
        replicate: (n,) replication, from 0.
        fit: of all of it.

    Returns:
        (L, L) covariance and degrees of freedom; None with fewer than two replications that can be fitted separately.
    """
    spread = replication_spread(columns, output, replicate, fit)
    df = len(spread) - 1
    return (np.asarray(spread.T @ spread / df), df) if df > 0 else None


def replication_spread(columns: FloatArray, output: FloatArray, replicate: IntArray, fit: LinearFit) -> FloatArray:
    """(n_rep, L) deviations of each replication's coefficients from those of all, scaled as an error of the latter.

    Their mean square over n_rep - 1 is the covariance of `between_replications`; arguments as there.
    """
    deviations = np.empty((0, columns.shape[1]))
    for alone in _each_alone(columns, output, replicate, fit.names):
        lower = np.linalg.cholesky(alone.root @ alone.root.T)
        deviations = np.vstack([deviations, np.linalg.solve(lower, alone.coefficients - fit.coefficients)])
    return np.asarray(deviations @ np.linalg.cholesky(fit.root @ fit.root.T).T)


def _each_alone(
    columns: FloatArray, output: FloatArray, replicate: IntArray, names: tuple[str, ...]
) -> list[LinearFit]:
    """One fit per replication; replications with too few points (incomplete) are left out. The triangles of those of
    one size are made at once.
    """
    ahead, sizes = np.argsort(replicate, kind="stable"), np.bincount(replicate)
    first = np.cumsum(sizes) - sizes
    fits = {}
    for size in np.unique(sizes):
        alike = np.flatnonzero(sizes == size)
        rows = ahead[first[alike, None] + np.arange(size)]
        triangles = np.linalg.qr(np.concatenate([columns[rows], output[rows][..., None]], axis=2), mode="r")
        for r, of, triangle in zip(alike, rows, triangles, strict=True):
            try:
                fit = Triangle(names, triangle, int(size)).solve()
                refined = fit.condition >= CONDITION
                fits[r] = least_squares(columns[of], output[of], names) if refined else fit
            except RankError:
                continue
    return [fits[r] for r in sorted(fits)]


def _drift(
    coefficients: FloatArray, roots: FloatArray, direction: FloatArray, ss_w: float, df_w: int
) -> tuple[float, FTest]:
    """Variation of direction . coefficients between n replications' (n, L) coefficients with (n, L, L) roots: its
    sigma, scaled as sigma_w is, and its F test.

    Replications are weighted by their information about the value, so F is also exact for unequal ones.
    """
    df_b = len(coefficients) - 1
    if df_b <= 0 or not np.any(direction):
        return NAN, FTest(NAN, max(df_b, 0), df_w)
    direction = direction / np.linalg.norm(direction)
    values = np.array([each @ direction for each in coefficients])
    weights = 1.0 / np.sum((direction @ roots) ** 2, axis=1)
    ss_b = float(weights @ (values - weights @ values / np.sum(weights)) ** 2)
    return float(np.sqrt(ss_b / df_b)), ratio(ss_b, df_b, ss_w, df_w)
