"""Precision of a design, before any data."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.split_plot.grouping import Nesting, Variances
from rig.fitter.split_plot.precision import Moments


@dataclass(frozen=True, eq=False)
class Precision:
    """Expected precision of each term of a design, for assumed errors.

    Attributes:
        names: of the k coefficients.
        covariance: (k, k) of generalised least squares at the expected variances.
        df: (k,) degrees of freedom of each standard error with estimated variances; NaN if the design does not
            determine one of them.
    """

    names: tuple[str, ...]
    covariance: FloatArray
    df: FloatArray

    @property
    def stderr(self) -> FloatArray:
        """(k,) standard errors, in units of y per unit of the column."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))


def forecast(nesting: Nesting, variances: Variances, *, estimable: bool) -> Precision:
    """Precision of the coefficients at these variances; `estimable`: whether data could separate the errors."""
    moments, k = Moments(nesting.structure(variances)), len(nesting.fixed.names)
    df = moments.df(np.eye(k), moments.inverse_information) if estimable else np.full(k, np.nan)
    return Precision(nesting.fixed.names, moments.covariance, df)
