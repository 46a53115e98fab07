"""Many responses over one split-plot design, fitted together: simulations, several transducers, resampling."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import special

from rig.fitter.arrays import FloatArray
from rig.fitter.split_plot.spectrum import Spectrum


@dataclass(frozen=True, eq=False)
class SplitPlotBatch:
    """REML fits of m responses, one row each; attributes have the same meaning as in `SplitPlotFit`.

    Attributes:
        coefficients: (m, k).
        variance_subplot: (m,).
        ratio: (m,) whole-plot variance over subplot variance; zero at the boundary.
        reml_loglik: (m,).
        spectrum: of the design.
    """

    coefficients: FloatArray
    variance_subplot: FloatArray
    ratio: FloatArray
    reml_loglik: FloatArray
    spectrum: Spectrum

    @property
    def sigma_subplot(self) -> FloatArray:
        """(m,) standard deviation of the subplot error, in units of y."""
        return np.asarray(np.sqrt(self.variance_subplot))

    @property
    def sigma_wholeplot(self) -> FloatArray:
        """(m,) standard deviation of the whole-plot error, in units of y."""
        return np.asarray(np.sqrt(self.ratio * self.variance_subplot))

    @property
    def boundary(self) -> FloatArray:
        """(m,) True where the whole-plot variance is estimated at zero."""
        return np.asarray(self.ratio == 0.0)

    @cached_property
    def stderr(self) -> FloatArray:
        """(m, k) standard errors for known variances."""
        unit, *_ = self._units(np.eye(self.coefficients.shape[1]))
        return np.asarray(np.sqrt(unit * self.variance_subplot[:, None]))

    def variance(self, columns: FloatArray, *, new_whole_plot: bool = False, new_readings: float = 0.0) -> FloatArray:
        """(m, c) Kenward-Roger variances of the fixed part at (c, k) `columns`; see `SplitPlotFit.variance`."""
        columns = np.atleast_2d(columns)
        extra = new_readings + float(new_whole_plot) * self.ratio
        total = self._units(columns)[0] + self._bias(columns) + extra[:, None]
        return np.asarray(total * self.variance_subplot[:, None])

    def df(self, columns: FloatArray, *, new_whole_plot: bool = False, new_readings: float = 0.0) -> FloatArray:
        """(m, c) degrees of freedom of these variances."""
        _, by_subplot, by_wholeplot = self._units(np.atleast_2d(columns))
        by_subplot = by_subplot + new_readings
        by_wholeplot = by_wholeplot + float(new_whole_plot)
        total = by_subplot + self.ratio[:, None] * by_wholeplot
        ee, ew, ww = (each[:, None] for each in self._spread)
        variance = ee * by_subplot**2 + 2.0 * ew * by_subplot * by_wholeplot + ww * by_wholeplot**2
        return np.asarray(2.0 * total**2 / variance)

    def interval(
        self, columns: FloatArray, level: float = 0.95, *, new_whole_plot: bool = False, new_readings: float = 0.0
    ) -> FloatArray:
        """(m, c) half-widths of the intervals around coefficients @ columns.T; see `SplitPlotFit.interval`."""
        df = self.df(columns, new_whole_plot=new_whole_plot, new_readings=new_readings)
        variance = self.variance(columns, new_whole_plot=new_whole_plot, new_readings=new_readings)
        return np.asarray(special.stdtrit(df, 0.5 * (1.0 + level)) * np.sqrt(variance))

    @cached_property
    def _shrinkage(self) -> FloatArray:
        """(m, W) predicted errors of the whole plots."""
        return np.asarray(1.0 / (1.0 + np.outer(self.ratio, self.spectrum.all_xi)))

    def _units(self, columns: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(m, c) variance at subplot variance one, and its derivatives by subplot and by whole-plot variance."""
        base = np.sum((columns @ self.spectrum.fixed.root) ** 2, axis=1)
        loading = ((columns @ self.spectrum.loading) ** 2).T
        d, ratio = self._shrinkage, self.ratio[:, None]
        by_subplot = base + (ratio**2 * self.spectrum.all_xi * d**2) @ loading
        return base + (ratio * d) @ loading, by_subplot, d**2 @ loading

    @cached_property
    def _spread(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(m,) variances and covariance of the estimated variances, at subplot variance one: ee, ew, ww."""
        xi, d2 = self.spectrum.xi, self._shrinkage[:, : len(self.spectrum.xi)] ** 2
        ee, ew, ww = 0.5 * (d2.sum(axis=1) + self.spectrum.rest_df), 0.5 * d2 @ xi, 0.5 * d2 @ xi**2
        determinant = ee * ww - ew**2
        inside = self.ratio > 0.0
        return (
            np.where(inside, ww / determinant, 1.0 / ee),
            np.where(inside, -ew / determinant, 0.0),
            np.where(inside, ee / determinant, 0.0),
        )

    def _bias(self, columns: FloatArray) -> FloatArray:
        """(m, c) Kenward and Roger's addition to the variance, at subplot variance one."""
        r = len(self.spectrum.xi)
        loading = ((columns @ self.spectrum.loading[:, :r]) ** 2).T
        ee, ew, ww = self._spread
        of_ratio = ww - 2.0 * self.ratio * ew + self.ratio**2 * ee
        of_ratio = np.where(self.boundary, 0.0, of_ratio)
        return np.asarray(2.0 * of_ratio[:, None] * ((self.spectrum.xi * self._shrinkage[:, :r] ** 3) @ loading))
