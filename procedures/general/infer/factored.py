"""The covariance of a fit's coefficients as T M T', which is accurate for nearly dependent columns.

In powers of an abscissa far from zero (years, kelvin, hPa) x C x' is a small difference of large numbers: its error is
eps times the condition number squared. With T the inverse of the triangle of the columns, x T is about as large as the
answer, and the error is eps times the condition number.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from rig.fitter import LinearFit
from rig.fitter.arrays import FloatArray
from rig.fitter.split_plot import SplitPlotFit

LEAST_DIGITS = 1e-3
"""Maximum accepted relative rounding error of a variance, and of a curve in standard deviations."""

EPS = float(np.finfo(float).eps)


@dataclass(frozen=True, eq=False)
class Factored:
    """A covariance and its derivatives by the variances, as root @ (.) @ root.T.

    Attributes:
        root: (k, k).
        covariance: (k, k) of root.T's combinations.
        derivatives: (c, k, k) of `covariance` by the variances.

    """

    root: FloatArray
    covariance: FloatArray
    derivatives: FloatArray

    @staticmethod
    def of(fit: LinearFit | SplitPlotFit) -> Factored:
        """From a fit; with zero instead of derivatives for one without degrees of freedom."""
        if isinstance(fit, LinearFit):
            unit, known = np.eye(len(fit.names)), fit.df > 0
            return Factored(fit.root, (fit.sigma**2 if known else 0.0) * unit, np.array([unit] if known else []))
        moments = fit.moments.in_basis()
        covariance = np.asarray(moments.covariance + moments.small_sample_bias)  # Kenward and Roger's
        return Factored(fit.structure.spectrum.fixed.root, covariance, moments.derivatives)

    @staticmethod
    def plain(covariance: FloatArray, derivatives: FloatArray) -> Factored:
        """From a file without a factor: unchanged."""
        return Factored(np.eye(len(covariance)), covariance, derivatives)

    @staticmethod
    def from_dict(given: Mapping[str, Any]) -> Factored:
        """Restore from `to_dict`. Raises KeyError, TypeError or ValueError."""
        return Factored(*(np.array(given[name], np.float64) for name in ("root", "covariance", "derivatives")))

    def fits(self, k: int, c: int) -> bool:
        """Whether the numbers are finite and for k coefficients and c variances."""
        shapes = self.root.shape, self.covariance.shape, self.derivatives.shape
        finite = all(np.isfinite(each).all() for each in (self.root, self.covariance, self.derivatives))
        return shapes == ((k, k), (k, k), (c, k, k)) and finite

    def to_dict(self) -> dict[str, Any]:
        """JSON values."""
        return {name: getattr(self, name).tolist() for name in ("root", "covariance", "derivatives")}

    def moments(self, rows: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(n,) variance of the curve at (n, k) rows of the model, and (n, c) its derivatives by the variances."""
        seen = rows @ self.root
        variance, *gradient = (np.einsum("nl,nl->n", seen @ one, seen) for one in (self.covariance, *self.derivatives))
        return variance, np.array(gradient).reshape(-1, len(rows)).T

    def variance(self, rows: FloatArray) -> FloatArray:
        """(n,) variance of the curve at (n, k) rows of the model."""
        return self.moments(rows)[0]

    def gradient(self, rows: FloatArray) -> FloatArray:
        """(n, c) its derivatives by the variances."""
        return self.moments(rows)[1]

    def rounding(self, rows: FloatArray) -> FloatArray:
        """(n,) rounding error of `variance`."""
        seen, every = np.abs(rows @ self.root), np.abs(rows) @ np.abs(self.root)
        return np.asarray(EPS * np.einsum("nl,nl->n", every @ np.abs(self.covariance), 2.0 * seen + EPS * every))
