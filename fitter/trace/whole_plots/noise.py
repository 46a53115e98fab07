"""Noise within whole plots that grows with pressure: whether it does, how much, and what that makes readings worth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import special
from scipy.optimize import minimize_scalar

from fitter.arrays import FloatArray

STEEPEST = 1e3
"""Growth per psi over the noise at zero beyond which it makes no difference."""


@dataclass(frozen=True)
class Noise:
    """Standard deviation of a reading within its whole plot, sd = a (1 + c P).

    Attributes:
        at_zero_mV: a.
        per_psi_mV: a c.
        stderr: of both, from the curvature of the likelihood; some 20 % too small, as residuals are tied.
        p: probability of so clear a relation between squared residual and pressure where there is none.

    """

    at_zero_mV: float
    per_psi_mV: float
    stderr: tuple[float, float]
    p: float

    def sd(self, pressure_psia: FloatArray) -> FloatArray:
        """(n,) standard deviation at these pressures, mV."""
        return self.at_zero_mV + self.per_psi_mV * pressure_psia


def noise_of(residual: FloatArray, left: FloatArray, pressure_psia: FloatArray) -> Noise:
    """Estimate how noise grows with pressure.

    The test regresses squared residuals on pressure and studentises by their own scatter (Koenker, J. Econometrics 17
    (1981) 107), so that long tails do not pass for growth. The size maximises the normal likelihood.

    Args:
        residual: (n,) of one transducer within whole plots, mV.
        left: (n,) share of a reading's variance that the fit left in its residual.
        pressure_psia: (n,).

    """
    squares = residual**2 / np.maximum(left, 0.1)
    n, p = squares.size, pressure_psia - pressure_psia.mean()
    about = squares - squares.mean()
    total = float(about @ about)
    if total <= 0.0 or not np.any(p):
        return Noise(float(np.sqrt(squares.mean())), 0.0, (0.0, 0.0), 1.0)
    correlation = float(p @ about) / np.sqrt(total * float(p @ p))
    chance = float(special.chdtrc(1, n * correlation**2))
    highest, share = float(pressure_psia.max()), left / left.sum()

    def deviance(slope: float) -> float:
        shape = 1.0 + slope * pressure_psia
        return float(np.log(share @ (squares / shape**2)) + 2.0 * share @ np.log(shape))

    # by the logarithm of what the noise at the highest pressure is over that at zero
    best = minimize_scalar(
        lambda u: deviance(np.expm1(u) / highest), bounds=(-2.0, np.log1p(STEEPEST)), method="bounded"
    )
    slope = float(np.expm1(best.x)) / highest
    at_zero = float(np.sqrt(share @ (squares / (1.0 + slope * pressure_psia) ** 2)))
    sd = at_zero * (1.0 + slope * pressure_psia)
    design = np.column_stack([np.ones(n), pressure_psia]) / sd[:, None]
    spread = np.linalg.inv(2.0 * design.T @ (design * left[:, None]))
    return Noise(at_zero, at_zero * slope, (float(np.sqrt(spread[0, 0])), float(np.sqrt(spread[1, 1]))), chance)
