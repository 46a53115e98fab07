"""Noise that grows with the reading or anything else recorded: found beside the effects, and used as weights."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fitter.arrays import FloatArray
from fitter.trace.family import ALPHA, COUNTED
from fitter.trace.whole_plots.noise import Noise, noise_of

FEWEST = 20
FACTOR = 1.3
"""Between the quietest row and the loudest; less is not worth weights."""


@dataclass(frozen=True)
class Growth:
    """How the standard deviation of a row depends on something.

    Attributes:
        driver: on what; "fitted" for the size of the fitted response.
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
        return np.maximum(self.noise.sd((values - low) / (high - low)), 1e-6 * self.noise.at_zero_mV)


def growth_of(left: FloatArray, kept: FloatArray, drivers: Mapping[str, FloatArray]) -> Growth | None:
    """The driver that the noise depends on most clearly; None if on none.

    Args:
        left: (n,) residual beside the effects, units of the response, weights not applied.
        kept: (n,) share of a row's variance that the fit left in its residual.
        drivers: (n,) what it may depend on.

    """
    usable = {name: v for name, v in drivers.items() if np.ptp(v) > 1e-9 * np.max(np.abs(v))}
    if len(left) < FEWEST or not usable or not np.any(left):
        return None
    found = []
    for name, v in usable.items():
        low, high = float(v.min()), float(v.max())
        noise = noise_of(left, kept, (v - low) / (high - low))
        found.append(Growth(name, (low, high), noise, min(noise.p * len(usable) / COUNTED, 1.0)))
    best = min(found, key=lambda growth: growth.p)
    ends = best.noise.sd(np.array([0.0, 1.0]))
    return best if best.p <= ALPHA and max(ends) > FACTOR * min(ends) else None
