"""Noise that grows with the reading or another recorded quantity: detected beside the effects, and used for weights."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy import special

from fitter.arrays import FloatArray
from fitter.trace.chance import ALPHA, COUNTED

STEEPEST = 1e3
"""Growth per unit of the driver relative to the noise at zero below which it is negligible."""


@dataclass(frozen=True)
class Noise:
    """Standard deviation of a reading over a driver x, sd = a (1 + c x).

    Attributes:
        at_zero: a.
        per_unit: a c.
        stderr: of both, from the curvature of the likelihood; about 20 % too small, because residuals are dependent.
            NaN if the rows do not determine them.
        p: probability of such a relation between squared residual and driver by chance.
    """

    at_zero: float
    per_unit: float
    stderr: tuple[float, float]
    p: float

    def sd(self, driver: FloatArray) -> FloatArray:
        """(n,) standard deviation at these values of the driver, in units of the reading."""
        return self.at_zero + self.per_unit * driver


def noise_of(residual: FloatArray, left: FloatArray, driver: FloatArray) -> Noise:
    """Estimate how noise grows with a driver.

    The test regresses squared residuals on the driver and studentises by their own scatter (Koenker, J. Econometrics 17
    (1981) 107), so that long tails are not taken for growth. The size maximises the normal likelihood.

    Args:
        residual: (n,) of one response.
        left: (n,) share of a reading's variance in its residual.
        driver: (n,) variable on which it may depend.
    """
    squares = residual**2 / np.maximum(left, 0.1)
    n, p = squares.size, driver - driver.mean()
    about = squares - squares.mean()
    total = float(about @ about)
    if total <= 0.0 or not np.any(p):
        return Noise(float(np.sqrt(squares.mean())), 0.0, (0.0, 0.0), 1.0)
    correlation = float(p @ about) / np.sqrt(total * float(p @ p))
    chance = float(special.chdtrc(1, n * correlation**2))
    highest, share = float(driver.max()), left / left.sum()

    def deviance(slope: float) -> float:
        shape = 1.0 + slope * driver
        return float(np.log(share @ (squares / shape**2)) + 2.0 * share @ np.log(shape))

    # by the logarithm of the ratio of the noise at the highest value to that at zero
    from scipy.optimize import minimize_scalar  # noqa: PLC0415  # 0.14 s, for those who look

    best = minimize_scalar(
        lambda u: deviance(np.expm1(u) / highest), bounds=(-2.0, np.log1p(STEEPEST)), method="bounded"
    )
    slope = float(np.expm1(best.x)) / highest
    at_zero = float(np.sqrt(share @ (squares / (1.0 + slope * driver) ** 2)))
    sd = at_zero * (1.0 + slope * driver)
    told = 2.0 * left / sd**2
    try:
        spread = np.diag(np.linalg.inv([[told.sum(), told @ driver], [told @ driver, (told * driver) @ driver]]))
    except np.linalg.LinAlgError:  # all noise is at one value of the driver
        spread = np.full(2, np.nan)
    return Noise(at_zero, at_zero * slope, (float(np.sqrt(spread[0])), float(np.sqrt(spread[1]))), chance)


FEWEST = 20
FACTOR = 1.3
"""Minimum ratio of the largest to the smallest standard deviation for weights."""


@dataclass(frozen=True)
class Growth:
    """Dependence of a row's standard deviation on a variable.

    Attributes:
        driver: the variable; "fitted" for the size of the fitted response.
        span: values of the driver between which it was estimated.
        noise: sd as a line over the driver from 0 to 1 over its span, units of the response.
        p: family-wise, over all drivers.
    """

    driver: str
    span: tuple[float, float]
    noise: Noise
    p: float

    def sd(self, values: FloatArray) -> FloatArray:
        """(n,) standard deviation at values of the driver."""
        low, high = self.span
        return np.maximum(self.noise.sd((values - low) / (high - low)), 1e-6 * self.noise.at_zero)


def growth_of(left: FloatArray, kept: FloatArray, drivers: Mapping[str, FloatArray], sensors: int = 1) -> Growth | None:
    """The driver with the most significant relation to the noise; None if there is none.

    Args:
        left: (n,) residual with the effects, units of the response, unweighted.
        kept: (n,) share of a row's variance in its residual.
        drivers: (n,) variables on which it may depend.
        sensors: of the run, each of which is asked.
    """
    usable = {name: v for name, v in drivers.items() if np.ptp(v) > 1e-9 * np.max(np.abs(v))}
    if len(left) < FEWEST or not usable or not np.any(left):
        return None
    found = []
    for name, v in usable.items():
        low, high = float(v.min()), float(v.max())
        noise = noise_of(left, kept, (v - low) / (high - low))
        found.append(Growth(name, (low, high), noise, min(noise.p * len(usable) * sensors / COUNTED, 1.0)))
    best = min(found, key=lambda growth: growth.p)
    ends = best.noise.sd(np.array([0.0, 1.0]))
    return best if best.p <= ALPHA and max(ends) > FACTOR * min(ends) else None
