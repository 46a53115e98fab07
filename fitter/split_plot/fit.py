"""Result of a split-plot fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.quantiles import t_limit
from rig.fitter.split_plot.grouping import Nesting, Structure, Variances
from rig.fitter.split_plot.kenward_roger import KenwardRoger, ScaledF, selection
from rig.fitter.split_plot.precision import Moments, inverse_of


@dataclass(frozen=True, eq=False)
class SplitPlotFit:
    """y = X b + whole-plot error (+ replication error) + subplot error, by restricted maximum likelihood (REML).

    An error with estimated variance zero is left out of all results of the fit: standard errors and degrees of freedom
    are those of the model without it, residual degrees of freedom n - k if none is left.

    Attributes:
        names: of the k coefficients.
        coefficients: (k,) generalised least squares at the estimated variances.
        variances: the REML estimates, squared units of y.
        reml_loglik: restricted log-likelihood, -[(n - k) log(2 pi) + log|V| + log|X'V^-1 X| + r'V^-1 r] / 2 with r = y
            - X b: as lme4 and nlme define it. It depends on the units and coding of the columns.
        notes: notes for readers, such as a variance at zero; empty if there are none.
        whole_plots: (W,) identities, ascending.
        replicates: (R,) identities, ascending; None without replications.
        y: (n,) the response.
        nesting: whole plot and replication of each reading, and the columns.
        structure: the errors in spectral form.
    """

    names: tuple[str, ...]
    coefficients: FloatArray
    variances: Variances
    reml_loglik: float
    notes: tuple[str, ...]
    whole_plots: IntArray
    replicates: IntArray | None
    y: FloatArray
    nesting: Nesting
    structure: Structure

    @property
    def n(self) -> int:
        """Number of readings."""
        return len(self.y)

    @property
    def sigma_subplot(self) -> float:
        """Standard deviation of the error of one reading within its whole plot, in units of y."""
        return float(np.sqrt(self.variances.subplot))

    @property
    def sigma_wholeplot(self) -> float:
        """Standard deviation of the error common to the readings of one whole plot."""
        return float(np.sqrt(self.variances.wholeplot))

    @property
    def sigma_replicate(self) -> float | None:
        """Standard deviation of the error common to the whole plots of one replication; None without replications."""
        return None if self.variances.replicate is None else float(np.sqrt(self.variances.replicate))

    @property
    def boundary(self) -> bool:
        """Whether a variance is estimated at zero."""
        return self.variances.wholeplot == 0.0 or self.variances.replicate == 0.0

    @cached_property
    def moments(self) -> Moments:
        """Covariance of coefficients and variances."""
        return Moments(self.structure)

    @property
    def covariance(self) -> FloatArray:
        """(k, k) covariance of the coefficients for known variances."""
        return self.moments.covariance

    @cached_property
    def stderr(self) -> FloatArray:
        """(k,) standard errors for known variances."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @cached_property
    def conditional_residuals(self) -> FloatArray:
        """(n,) y minus the fixed part and the predicted errors of whole plot and replication."""
        spectrum = self.structure.spectrum
        _, in_z, rest = spectrum.parts(self.y)
        return np.asarray(rest + spectrum.left @ (in_z / (1.0 + self.structure.ratio * spectrum.xi)))

    @property
    def marginal_residuals(self) -> FloatArray:
        """(n,) y minus the fixed part."""
        return np.asarray(self.y - self.nesting.fixed.columns @ self.coefficients)

    @property
    def blup(self) -> FloatArray:
        """(W,) predicted errors of the whole plots, best linear unbiased (the replication's own error not included)."""
        return self._predicted(self.nesting.whole_plot, self.variances.wholeplot)

    @property
    def blup_replicate(self) -> FloatArray | None:
        """(R,) predicted errors of the replications; None without replications."""
        if self.nesting.replicate_of is None:
            return None
        return self._predicted(self.nesting.replicate_of[self.nesting.whole_plot], self.variances.replicate or 0.0)

    def _predicted(self, group: IntArray, variance: float) -> FloatArray:
        return np.asarray(np.bincount(group, self.conditional_residuals) * (variance / self.variances.subplot))

    def satterthwaite(self, contrasts: FloatArray) -> FloatArray:
        """(m,) degrees of freedom of (m, k) `contrasts`, as lmerTest: from the observed information."""
        _, in_z, rest = self.structure.spectrum.parts(self.y)
        spread = inverse_of(self.moments.observed_information(in_z, float(rest @ rest)))
        return self.moments.df(np.atleast_2d(contrasts), spread)

    def kenward_roger(self) -> KenwardRoger:
        """Covariance, degrees of freedom and F tests that allow for the uncertainty of the variances."""
        return KenwardRoger(self.names, self.coefficients, self.moments)

    @property
    def df_method(self) -> str:
        """Source of `df`: "kenward-roger", or "residual" if no variance above the subplot's remains."""
        return "kenward-roger" if len(self.structure.variances) > 1 else "residual"

    @cached_property
    def df(self) -> FloatArray:
        """(k,) degrees of freedom of each coefficient."""
        return self.kenward_roger().df(np.eye(len(self.names)))

    def f_test(self, terms: Sequence[str]) -> ScaledF:
        """Kenward-Roger test that the coefficients of all `terms` are zero."""
        return self.kenward_roger().f_test(selection(self.names, terms))

    def predict(self, columns: FloatArray) -> FloatArray:
        """(m,) fixed part at (m, k) `columns`."""
        return np.asarray(columns @ self.coefficients)

    def variance(self, columns: FloatArray, *, new_whole_plot: bool = False, new_readings: float = 0.0) -> FloatArray:
        """(m,) Kenward-Roger variance of the fixed part at (m, k) `columns`, in squared units of y.

        Args:
            columns: (m, k).
            new_whole_plot: add the error of a new whole plot (and of a new replication).
            new_readings: multiple of the variance of one reading to add: 1 for a future reading, 1 + 1/r for its
                difference from the mean of r others in its whole plot (then `columns` are differences too).
        """
        columns, extra = np.atleast_2d(columns), self._extra(new_whole_plot, new_readings)
        seen = columns @ self.structure.spectrum.fixed.root
        fixed = np.einsum("mk,kl,ml->m", seen, self._in_basis.covariance, seen)
        return np.asarray(fixed + extra @ self.structure.variances)

    def interval(
        self, columns: FloatArray, level: float = 0.95, *, new_whole_plot: bool = False, new_readings: float = 0.0
    ) -> FloatArray:
        """(m,) half-width of the interval around `predict`, in units of y; arguments as for `variance`.

        Its t limit has the degrees of freedom of that variance as a whole, by Satterthwaite's formula.
        """
        extra = self._extra(new_whole_plot, new_readings)
        df = self._degrees(columns, extra)
        limit = np.array([t_limit(level, each) for each in df])
        variance = self.variance(columns, new_whole_plot=new_whole_plot, new_readings=new_readings)
        return np.asarray(limit * np.sqrt(variance))

    def df_of(self, columns: FloatArray) -> FloatArray:
        """(m,) degrees of freedom of `variance` of the fixed part alone, at (m, k) `columns`."""
        return self._degrees(columns, self._extra(new_whole_plot=False, new_readings=0.0))

    @cached_property
    def _in_basis(self) -> KenwardRoger:
        """That of the orthonormal basis: powers of settings far from zero lose digits of their variances."""
        root = self.structure.spectrum.fixed.root
        return KenwardRoger(self.names, np.asarray(np.linalg.solve(root, self.coefficients)), self.moments.in_basis())

    def _degrees(self, columns: FloatArray, extra: FloatArray) -> FloatArray:
        moments, seen = self._in_basis.moments, np.atleast_2d(columns) @ self.structure.spectrum.fixed.root
        return moments.df(seen, moments.inverse_information, extra)

    def _extra(self, new_whole_plot: bool, new_readings: float) -> FloatArray:
        above = len(self.structure.variances) - 1
        return np.array([new_readings, *[float(new_whole_plot)] * above])
