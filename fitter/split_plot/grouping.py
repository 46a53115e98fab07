"""Grouping of readings with common errors, and the resulting random columns for given variances."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.split_plot.spectrum import FixedPart, Spectrum


@dataclass(frozen=True)
class Variances:
    """Variances of the three errors, in squared units of y; `replicate` is None without replications."""

    subplot: float
    wholeplot: float
    replicate: float | None = None


@dataclass(frozen=True, eq=False)
class Structure:
    """The errors of a fit in spectral form. Errors with variance zero are left out.

    Attributes:
        spectrum: of random columns whose effects are independent with one variance.
        variances: (c,) that of the subplot error first, then those of the errors above it that are not zero.
        ratio: variance of the spectrum's effects over that of the subplot error.
        shapes: (c - 1, W, W) contribution of each error above to the covariance of the spectrum's effects at variance
            one, in the basis of the spectrum's right vectors.
    """

    spectrum: Spectrum
    variances: FloatArray
    ratio: float
    shapes: FloatArray


@dataclass(frozen=True, eq=False)
class Nesting:
    """Readings in whole plots, whole plots in replications, both numbered from 0.

    Attributes:
        fixed: the columns of the model.
        whole_plot: (n,).
        replicate_of: (W,) replication of each whole plot, or None.

    """

    fixed: FixedPart
    whole_plot: IntArray
    replicate_of: IntArray | None

    @property
    def whole_plots(self) -> int:
        """Number of whole plots."""
        return int(self.whole_plot.max()) + 1

    @cached_property
    def wholeplot_spectrum(self) -> Spectrum:
        """One effect per whole plot."""
        return Spectrum.of(self.fixed, np.eye(self.whole_plots)[self.whole_plot])

    @cached_property
    def replicate_spectrum(self) -> Spectrum:
        """One effect per replication."""
        return Spectrum.of(self.fixed, self.replicate_indicators)

    def structure(self, variances: Variances) -> Structure:
        """Spectral form at these variances; that of the subplot error must be above zero."""
        subplot, wholeplot, replicate = variances.subplot, variances.wholeplot, variances.replicate or 0.0
        if replicate > 0.0 and wholeplot > 0.0:
            return self._both(subplot, wholeplot, replicate)
        if replicate > 0.0:
            return _single(self.replicate_spectrum, subplot, replicate)
        return _single(self.wholeplot_spectrum, subplot, wholeplot)

    def _both(self, subplot: float, wholeplot: float, replicate: float) -> Structure:
        """Effects of whole plots and replications as one set L d, d independent: L L' = I + rho N N'.

        N is the indicator matrix of replications. For a replication of c whole plots I + rho 1 1' has the eigenvalue 1
        + rho c once and 1 otherwise, so L and its inverse are closed forms.
        """
        n, rho = self._membership, replicate / wholeplot
        size = n.sum(axis=0)
        grown = 1.0 + rho * size
        identity = np.eye(len(n))
        factor = identity + (n * ((np.sqrt(grown) - 1.0) / size)) @ n.T
        spectrum = Spectrum.of(self.fixed, factor[self.whole_plot])
        of_wholeplot = identity - (n * (rho / grown)) @ n.T
        of_replicate = (n / grown) @ n.T
        v = spectrum.right
        shapes = np.stack([v.T @ of_wholeplot @ v, v.T @ of_replicate @ v])
        return Structure(spectrum, np.array([subplot, wholeplot, replicate]), wholeplot / subplot, shapes)

    @property
    def replicate_indicators(self) -> FloatArray:
        """(n, R) one where a reading is in the replication."""
        return self._membership[self.whole_plot]

    @cached_property
    def _membership(self) -> FloatArray:
        if self.replicate_of is None:
            raise ValueError("there are no replications")
        return np.asarray(np.eye(int(self.replicate_of.max()) + 1)[self.replicate_of])


def _single(spectrum: Spectrum, subplot: float, above: float) -> Structure:
    if above == 0.0:
        return Structure(spectrum, np.array([subplot]), 0.0, spectrum.identity[:0])
    return Structure(spectrum, np.array([subplot, above]), above / subplot, spectrum.identity)
