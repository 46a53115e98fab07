"""Inference on coefficients that allows for the uncertainty of the variances.

Kenward and Roger, "Small sample inference for fixed effects from restricted maximum likelihood", Biometrics 53 (1997)
983-997, as pbkrtest computes it. For one contrast its degrees of freedom are Satterthwaite's with the expected
information.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.quantiles import f_tail
from rig.fitter.split_plot.precision import Moments

NO_MEAN = 0.01
"""Distance from two degrees of freedom within which F has no mean for scaling; pbkrtest leaves it unscaled."""


@dataclass(frozen=True)
class ScaledF:
    """A scaled F statistic: `value` is scale * Wald / ndf, to be judged by F(ndf, ddf)."""

    value: float
    ndf: int
    ddf: float
    scale: float

    @property
    def p(self) -> float:
        """Probability of a larger value when the contrasts are zero."""
        return f_tail(self.value, self.ndf, self.ddf)


@dataclass(frozen=True, eq=False)
class KenwardRoger:
    """Kenward-Roger inference for one fit.

    Attributes:
        names: of the k coefficients.
        coefficients: (k,).
        moments: of the fit, at the estimated variances.

    """

    names: tuple[str, ...]
    coefficients: FloatArray
    moments: Moments

    @cached_property
    def covariance(self) -> FloatArray:
        """(k, k) adjusted covariance of the coefficients."""
        return np.asarray(self.moments.covariance + self.moments.small_sample_bias)

    @property
    def stderr(self) -> FloatArray:
        """(k,) adjusted standard errors."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    def df(self, contrasts: FloatArray) -> FloatArray:
        """(m,) degrees of freedom of each of (m, k) `contrasts` separately."""
        return self.moments.df(np.atleast_2d(contrasts), self.moments.inverse_information)

    def f_test(self, contrasts: FloatArray, value: FloatArray | float = 0.0) -> ScaledF:
        """Test that contrasts @ coefficients = value, all together.

        Args:
            contrasts: (q, k) independent rows.
            value: (q,) or one number.

        """
        contrasts = np.atleast_2d(contrasts)
        q = len(contrasts)
        off = contrasts @ self.coefficients - value
        wald = float(off @ np.linalg.solve(contrasts @ self.covariance @ contrasts.T, off)) / q
        ddf, scale = self._denominator(contrasts)
        return ScaledF(scale * wald, q, ddf, scale)

    def _denominator(self, contrasts: FloatArray) -> tuple[float, float]:
        q, spread = len(contrasts), self.moments.inverse_information
        seen = np.linalg.solve(
            contrasts @ self.moments.covariance @ contrasts.T, contrasts @ self.moments.derivatives @ contrasts.T
        )
        traces = np.trace(seen, axis1=1, axis2=2)
        a1 = float(traces @ spread @ traces)
        a2 = float(np.einsum("ij,iab,jba->", spread, seen, seen))
        b = (a1 + 6.0 * a2) / (2.0 * q)
        g = ((q + 1) * a1 - (q + 4) * a2) / ((q + 2) * a2)
        c = np.array([g, q - g, q + 2 - g]) / (3 * q + 2 * (1 - g))
        variance = 1.0 + c[0] * b, 1.0 - c[1] * b, 1.0 - c[2] * b
        rho = ((1.0 - a2 / q) / variance[1]) ** 2 * variance[0] / variance[2] / q
        ddf = float(4.0 + (q + 2) / (q * rho - 1.0))
        if abs(ddf - 2.0) < NO_MEAN:
            return ddf, 1.0
        return ddf, float(ddf * (1.0 - a2 / q) / (ddf - 2.0))


def selection(names: Sequence[str], terms: Sequence[str]) -> FloatArray:
    """(q, k) contrasts that select `terms` from `names`.

    Raises:
        ValueError: a term is not among the names.
    """
    unknown = [term for term in terms if term not in names]
    if unknown or not terms:
        raise ValueError(f"no such term: {', '.join(unknown)}; there are {', '.join(names)}")
    return np.eye(len(names))[[list(names).index(term) for term in terms]]
