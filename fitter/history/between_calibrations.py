"""Variation between calibrations beyond their own error, and least squares that allows for it.

The values of a parameter are y = X b + u + e: e is the error within a calibration, with known variances W (diagonal), u
is the variation between calibrations, with covariance psi K. K is one of:

    scatter   K = 1: independent between calibrations (mounting, temperature)
    walk      K_ij = min(t_i, t_j): random walk, with independent steps that add up

psi is estimated by the method of Paule and Mandel (J. Res. NBS 87, 377, 1982): the generalised residual sum of squares

    Q(psi) = min_b (y - X b)' (W + psi K)^-1 (y - X b)

falls with psi; the estimate is where it equals its expectation, m - p, and zero where Q(0) is below that.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from scipy.linalg import null_space

from rig.fitter.arrays import FloatArray
from rig.fitter.history.series import Series


class Between(Enum):
    """Kind of variation of a parameter between calibrations."""

    SCATTER = "scatter"
    WALK = "walk"

    def among(self, years: FloatArray) -> FloatArray:
        """(m, m) K."""
        if self is Between.SCATTER:
            return np.eye(len(years))
        return np.asarray(np.minimum.outer(years, years) - years[0])

    def with_later(self, years: FloatArray, later: FloatArray) -> FloatArray:
        """(T, m) covariance over psi of u at times `later` with u at the calibrations."""
        if self is Between.SCATTER:
            return np.zeros((len(later), len(years)))
        return np.tile(years - years[0], (len(later), 1))

    def of_later(self, years: FloatArray, later: FloatArray) -> FloatArray:
        """(T,) variance over psi of u at times `later`."""
        return np.ones(len(later)) if self is Between.SCATTER else later - years[0]


@dataclass(frozen=True, eq=False)
class Profile:
    """Q as a function of psi, and of a factor on the variances within: sum of z_j^2 / (factor + psi lambda_j).

    Attributes:
        squares: (m - p,) z_j^2.
        roots: (m - p,) lambda_j.

    """

    squares: FloatArray
    roots: FloatArray

    @classmethod
    def of(cls, series: Series, columns: FloatArray, between: Between) -> Profile:
        """Q of a series about (m, p) `columns`."""
        free = null_space(columns.T)
        lower = np.linalg.cholesky(free.T @ (series.variance[:, None] * free))
        whitened = np.linalg.solve(lower, free.T)
        roots, vectors = np.linalg.eigh(whitened @ between.among(series.years) @ whitened.T)
        return cls((vectors.T @ (whitened @ series.values)) ** 2, np.maximum(roots, 0.0))

    @property
    def df(self) -> int:
        """Degrees of freedom of Q, m - p."""
        return len(self.squares)

    def psi(self, target: FloatArray, factor: FloatArray) -> FloatArray:
        """(n,) psi at which Q is (n,) `target`, for (n,) factors; zero if Q is smaller already at psi = 0.

        1/Q is concave in psi, and a straight line if all roots are equal: Newton's method on it converges from below in
        a few steps.
        """
        psi = np.zeros_like(target)
        for _ in range(100):
            variance = factor[:, None] + psi[:, None] * self.roots
            shares = self.squares / variance
            q = shares.sum(axis=1)
            fall = np.sum(shares * self.roots / variance, axis=1)
            excess = q > target
            ahead = np.divide(q * (q / target - 1.0), fall, out=np.zeros_like(q), where=excess & (fall > 0.0))
            psi += ahead
            if np.all(ahead <= 1e-12 * psi):
                break
        return psi

    def paule_mandel(self) -> float:
        """The estimate of psi."""
        return float(self.psi(np.array([float(self.df)]), np.ones(1))[0])


@dataclass(frozen=True, eq=False)
class Fit:
    """Generalised least squares at an estimated psi.

    Attributes:
        coefficients: (p,).
        covariance: (p, p), with the scale of Knapp and Hartung.
        psi: variance between calibrations (per year, for a walk).
        df: m - p.
        loglik: restricted log-likelihood, up to a constant.

    """

    coefficients: FloatArray
    covariance: FloatArray
    psi: float
    df: int
    loglik: float


def fit(series: Series, columns: FloatArray, between: Between) -> Fit:
    """Fit (m, p) columns, p < m.

    The covariance is scaled by Q(psi) / (m - p), to be used with Student's t on m - p degrees of freedom (Knapp and
    Hartung, Statistics in Medicine 22, 2693, 2003). If all calibrations have equal variances this is ordinary least
    squares and its t is exact.
    """
    psi = Profile.of(series, columns, between).paule_mandel()
    v = np.diag(series.variance) + psi * between.among(series.years)
    weighted = np.linalg.solve(v, np.column_stack([columns, series.values]))
    information = columns.T @ weighted[:, :-1]
    covariance = np.linalg.inv(information)
    coefficients = covariance @ (columns.T @ weighted[:, -1])
    residual = series.values - columns @ coefficients
    q = float(residual @ np.linalg.solve(v, residual))
    df = len(series) - columns.shape[1]
    loglik = -0.5 * (np.linalg.slogdet(v)[1] + np.linalg.slogdet(information)[1] + q)
    return Fit(coefficients, covariance * q / df, psi, df, float(loglik))
