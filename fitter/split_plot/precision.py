"""Precision of the coefficients by generalised least squares at given variances, and precision of the variances.

With H = (X'V^-1 X)^-1 X'V^-1 and V = sum theta_i V_i the derivatives of the covariance C = H V H' by the variances are
H V_i H', so that C, its derivatives and everything below are sums without cancellation in the spectral form.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import solve_triangular

from rig.fitter.arrays import FloatArray
from rig.fitter.split_plot.grouping import Structure


@dataclass(frozen=True, eq=False)
class Moments:
    """Covariance of the coefficients and of the variances theta (c of them, as in `Structure`)."""

    structure: Structure

    @cached_property
    def covariance(self) -> FloatArray:
        """(k, k) covariance C of the coefficients."""
        spectrum = self.structure.spectrum
        of_effects = spectrum.loading * np.sqrt(self.structure.ratio * self._shrinkage)
        root = np.column_stack([spectrum.fixed.root, of_effects])
        return np.asarray(self.structure.variances[0] * root @ root.T)

    @cached_property
    def derivatives(self) -> FloatArray:
        """(c, k, k) derivatives of C by the variances, H V_i H'."""
        spectrum, ratio = self.structure.spectrum, self.structure.ratio
        seen = spectrum.loading * self._shrinkage
        root = np.column_stack([spectrum.fixed.root, seen * (ratio * np.sqrt(spectrum.all_xi))])
        return np.stack([root @ root.T, *(seen @ shape @ seen.T for shape in self.structure.shapes)])

    @cached_property
    def expected_information(self) -> FloatArray:
        """(c, c) expected restricted information on the variances, tr(P V_i P V_j) / 2."""
        scaled = self._kernels / self._spread[:, None]
        information = np.einsum("iab,jba->ij", scaled, scaled)
        information[0, 0] += self.structure.spectrum.rest_df / self.structure.variances[0] ** 2
        return np.asarray(0.5 * information)

    def observed_information(self, in_z: FloatArray, rest: float) -> FloatArray:
        """(c, c) negative second derivatives of the restricted log-likelihood for the response with these parts.

        Args:
            in_z: (r,) its coordinates in the spectrum.
            rest: its sum of squares outside X and Z.

        """
        a = in_z / self._spread
        pulled = self._kernels @ a
        information = pulled @ (pulled / self._spread).T - self.expected_information
        subplot = self.structure.variances[0]
        information[0, 0] += rest / subplot**3
        return np.asarray(information)

    @cached_property
    def small_sample_bias(self) -> FloatArray:
        """(k, k) difference between the covariance and C, because the variances are estimates.

        Kenward and Roger (1997): 2 C [sum W_ij (Q_ij - P_i C P_j)] C with W the inverse information, equal to 2 sum
        W_ij H V_i P V_j H'; their third term is zero where V is linear in its parameters.
        """
        spectrum, ratio = self.structure.spectrum, self.structure.ratio
        r, s, d = len(spectrum.xi), spectrum.singular[:, None], self._shrinkage
        of_subplot = -ratio * s * d[:r, None] * spectrum.loading[:, :r].T
        of_others = [s * (shape[:r] @ (spectrum.loading * d).T) for shape in self.structure.shapes]
        cross = np.stack([of_subplot, *of_others]) / np.sqrt(self._spread)[:, None]
        return np.asarray(2.0 * np.einsum("ij,iak,jal->kl", self.inverse_information, cross, cross))

    def in_basis(self) -> Moments:
        """Moments of the coefficients of the orthonormal basis; with the columns' root T the above is T (.) T'."""
        spectrum = self.structure.spectrum
        root = spectrum.fixed.root
        fixed = replace(spectrum.fixed, root=np.eye(len(root)))
        seen = replace(spectrum, fixed=fixed, loading=solve_triangular(root, spectrum.loading))
        return Moments(replace(self.structure, spectrum=seen))

    @property
    def inverse_information(self) -> FloatArray:
        """(c, c) W, the large-sample covariance of the estimated variances."""
        return inverse_of(self.expected_information)

    def df(self, contrasts: FloatArray, spread: FloatArray, extra: FloatArray | None = None) -> FloatArray:
        """(m,) Satterthwaite degrees of freedom 2 v^2 / var(v) of the variances v = l'C l of contrasts l.

        Args:
            contrasts: (m, k).
            spread: (c, c) covariance of the variances.
            extra: (c,) additional multiples of each variance in v; for example for a new reading.
        """
        extra = np.zeros(len(self.structure.variances)) if extra is None else extra
        gradient = np.einsum("mk,ikl,ml->mi", contrasts, self.derivatives, contrasts) + extra
        value = gradient @ self.structure.variances  # C is homogeneous in the variances
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(2.0 * value**2 / np.einsum("mi,ij,mj->m", gradient, spread, gradient))

    @cached_property
    def _shrinkage(self) -> FloatArray:
        return np.asarray(1.0 / (1.0 + self.structure.ratio * self.structure.spectrum.all_xi))

    @cached_property
    def _spread(self) -> FloatArray:
        """(r,) variances of a response's coordinates in the spectrum."""
        return np.asarray(self.structure.variances[0] * (1.0 + self.structure.ratio * self.structure.spectrum.xi))

    @cached_property
    def _kernels(self) -> FloatArray:
        """(c, r, r) derivatives of the covariance of a response's coordinates in the spectrum by the variances."""
        s = self.structure.spectrum.singular
        r = len(s)
        return np.stack([np.eye(r), *(s[:, None] * shape[:r, :r] * s for shape in self.structure.shapes)])


def inverse_of(information: FloatArray) -> FloatArray:
    """(c, c) inverse of an information matrix whose rows may have very different units."""
    unit = np.sqrt(np.diag(information))
    return np.asarray(np.linalg.inv(information / np.outer(unit, unit)) / np.outer(unit, unit))
