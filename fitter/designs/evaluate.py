"""The precision that a design promises, before any measurement.

Definitions: A. C. Atkinson, A. N. Donev and R. D. Tobias, Optimum Experimental Designs, with SAS (2007), chapters 9 to
11; with whole plots P. Goos and B. Jones, Optimal Design of Experiments (2011), chapter 10, information X'V^-1 X.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.designs.determined import Freedom, freedom, points_that_would
from rig.fitter.designs.factors import Factor
from rig.fitter.designs.measure import Measure, optimal_measure
from rig.fitter.designs.plots import checked_eta, numbered, whitened
from rig.fitter.designs.region import DEPENDENT, Allowed, Columns, Region, lost_directions, named
from rig.fitter.errors import FitError

CLOSE = 1e-4
"""Accuracy of the bounds that efficiencies are relative to."""


@dataclass(frozen=True)
class Efficiencies:
    """Efficiencies relative to the best share of independent points (`measure.py`), from 0 to 1: at least these.

    No design exceeds 1, and with whole plots or few points none reaches it: the bound has neither the error of whole
    plots nor whole numbers of points.

    Attributes:
        d: (|M| / |M*|)^(1/p), M the information per point.
        a: ratio of the sums of the coefficients' variances, each times the mean square of its column over the region.
        g: p over n times the largest variance of a prediction (Kiefer and Wolfowitz: 1 at the bound).
        i: ratio of the mean variances of a prediction over the region.
    """

    d: float
    a: float
    g: float
    i: float


@dataclass(frozen=True, eq=False)
class Evaluation:
    """The precision of a design. Variances are in units of sigma^2, the error of one point.

    Attributes:
        region: factors and model.
        points: (n, k).
        whole_plot: (n,) from 0; None for independent points.
        eta: variance between whole plots over that within.
        undetermined: terms the design does not determine.
        would: (r, k) points that, added, would determine all terms; empty if all are determined.
        freedom: degrees of freedom.
    """

    region: Region
    points: FloatArray
    whole_plot: IntArray | None
    eta: float
    undetermined: tuple[str, ...]
    would: FloatArray
    freedom: Freedom

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the p terms."""
        return self.region.names

    @cached_property
    def covariance(self) -> FloatArray:
        """(p, p) of the coefficients by generalised least squares, over sigma^2; NaN for undetermined terms."""
        root = self.region.basis @ self._root
        covariance = np.asarray(root @ root.T)
        lost = np.isin(self.names, self.undetermined)
        covariance[lost, :] = covariance[:, lost] = np.nan
        return covariance

    @property
    def stderr(self) -> FloatArray:
        """(p,) standard errors of the coefficients, in units of sigma per unit of the column."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @property
    def correlation(self) -> FloatArray:
        """(p, p) correlations of the coefficients."""
        return np.asarray(self.covariance / np.outer(self.stderr, self.stderr))

    def correlated(self, limit: float = 0.9) -> tuple[tuple[str, str, float], ...]:
        """Pairs of terms whose coefficients are correlated by `limit` or more, largest first: nearly confounded."""
        r = np.where(np.isnan(self.correlation), 0.0, self.correlation)
        pairs = [(i, j) for i, j in zip(*np.triu_indices(len(r), 1), strict=True) if abs(r[i, j]) >= limit]
        pairs.sort(key=lambda pair: -abs(r[pair]))
        return tuple((self.names[i], self.names[j], float(r[i, j])) for i, j in pairs)

    def variance(self, points: ArrayLike) -> FloatArray:
        """(m,) variances of predictions at (m, k) points, over sigma^2; infinite with undetermined terms."""
        rows = self.region.raw(points) @ self.region.basis
        return np.full(len(rows), np.inf) if self.undetermined else np.asarray(np.sum((rows @ self._root) ** 2, axis=1))

    def profile(self, factor: int, steps: int = 21, at: ArrayLike | None = None) -> tuple[FloatArray, FloatArray]:
        """Settings of one factor over its range, and the variance of a prediction there.

        The other factors are `at` (k,), by default the middle of their ranges.
        """
        factors = self.region.factors
        middle = [f.levels[len(f.levels) // 2] if f.category else 0.5 * (f.low + f.high) for f in factors]
        x = factors[factor].steps(steps)
        points = np.tile(np.asarray(middle if at is None else at, np.float64), (x.size, 1))
        points[:, factor] = x
        return x, self.variance(points)

    @cached_property
    def shares(self) -> FloatArray:
        """(N,) variances of predictions over the region, ascending: their distribution (fraction of design space).

        A. Zahran, C. M. Anderson-Cook and R. H. Myers, J. Quality Technology 35 (2003) 377.
        """
        return np.sort(self.variance(self.region.settings))

    @property
    def largest_variance(self) -> float:
        """Largest variance of a prediction, over sigma^2, on a grid over the region."""
        return float(self.shares[-1])

    @property
    def mean_variance(self) -> float:
        """Mean variance of a prediction over the region, over sigma^2."""
        return float("inf") if self.undetermined else float(np.sum(self._root * (self.region.moments @ self._root)))

    @property
    def log_determinant(self) -> float:
        """Logarithm of |X'V^-1 X| sigma^(2p), in the caller's columns; -inf with undetermined terms."""
        if self.undetermined:
            return float("-inf")
        scale = np.linalg.slogdet(self.region.basis)[1]
        return float(-2.0 * (np.linalg.slogdet(self._root)[1] + scale))

    @cached_property
    def efficiency(self) -> Efficiencies:
        """Efficiencies relative to the best share of independent points; all zero with undetermined terms."""
        if self.undetermined:
            return Efficiencies(0.0, 0.0, 0.0, 0.0)
        n, p = len(self.points), len(self.names)
        limits = Limits.of(self.region)
        information = -2.0 * np.linalg.slogdet(self._root)[1]
        best = np.linalg.slogdet(limits.d.information)[1]
        a = float(np.sum(self._root * (limits.weight @ self._root)))
        return Efficiencies(
            d=float(np.exp((information - best) / p)) * limits.d.efficiency / n,
            a=_least(limits.a, limits.weight) / (n * a),
            g=p / (n * self.largest_variance),
            i=_least(limits.i, self.region.moments) / (n * self.mean_variance),
        )

    @cached_property
    def _root(self) -> FloatArray:
        """(p, rank) with root @ root.T the covariance in the region's basis, over sigma^2, without lost directions."""
        rows = whitened(self.region.rows(self.points), self.whole_plot, self.eta)
        _, values, right = np.linalg.svd(rows, full_matrices=False)
        kept = values > DEPENDENT * values[0]
        return np.asarray(right[kept].T / values[kept])


@dataclass(frozen=True, eq=False)
class Limits:
    """The best measures of a region: D-optimal, and of least A- and I-criterion.

    Attributes:
        weight: (p, p) of the A-criterion in the region's basis: coefficients' variances times mean squares of columns.
    """

    d: Measure
    a: Measure
    i: Measure
    weight: FloatArray

    @classmethod
    def of(cls, region: Region) -> Limits:
        """The best measures on the region's grid of settings."""
        rows = region.rows(np.unique(np.vstack([region.settings, region.candidates]), axis=0))
        weight = region.basis.T @ (region.basis * region.mean_squares[:, None])
        d, a, i = (optimal_measure(rows, target, CLOSE) for target in (None, weight, region.moments))
        return cls(d, a, i, weight)


def evaluate(
    points: ArrayLike,
    factors: Sequence[Factor | ArrayLike],
    columns: Columns,
    names: Sequence[str] | None = None,
    *,
    whole_plot: ArrayLike | None = None,
    eta: float = 1.0,
    allowed: Allowed | None = None,
) -> Evaluation:
    """The precision of any design: a grid, a central composite, a person's own list of points.

    Args:
        points: (n, k) settings.
        factors: k of them, over whose ranges the calibration is used.
        columns: model matrix (n, p) of (n, k) points.
        names: of the p terms.
        whole_plot: (n,) identity of each point's whole plot; None for independent points.
        eta: variance between whole plots over that within.
        allowed: which of (m, k) points belong to the region; by default all.

    Raises:
        FitError: the model has terms that no design over these ranges tells apart, or arguments do not fit together.
    """
    return evaluated(Region.of(factors, columns, names, allowed), points, whole_plot, eta)


def evaluated(region: Region, points: ArrayLike, whole_plot: ArrayLike | None, eta: float) -> Evaluation:
    """`evaluate` for a region."""
    region = _opened(region)
    array = np.asarray(points, np.float64)
    raw = region.raw(array)
    if not len(array):
        raise FitError("the design has no points")
    rows = raw @ region.basis
    plots = numbered(whole_plot, len(array))
    candidates = region.candidates
    would = candidates[points_that_would(rows, region.rows(candidates))]
    return Evaluation(
        region=region,
        points=array,
        whole_plot=plots,
        eta=checked_eta(eta) if plots is not None else 0.0,
        undetermined=named(region.basis @ lost_directions(rows), np.sqrt(region.mean_squares), region.names),
        would=would,
        freedom=freedom(rows, array, plots),
    )


def _opened(region: Region) -> Region:
    """The region with further levels for factors whose own do not determine the terms."""
    try:
        region.basis  # noqa: B018
    except FitError:
        wider = [f if f.category or len(f.levels) < 2 else Factor.within(f.low, f.high, 9) for f in region.factors]
        return replace(region, factors=tuple(wider))
    return region


def _least(measure: Measure, target: FloatArray) -> float:
    """Lower bound of tr(M^-1 target) over all measures, by one that reaches it to its own efficiency."""
    return float(np.sum(np.linalg.inv(measure.information) * target)) * measure.efficiency
