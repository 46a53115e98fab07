"""A Gaussian process over one variable, by its waves: how much likelier than independent errors."""

from __future__ import annotations

import numpy as np

from rig.fitter.arrays import FloatArray

WAVES = 24
LENGTHS = (0.05, 0.1, 0.2, 0.4, 0.8)
"""Correlation lengths over the range of the variable."""
AMPLITUDES = (0.03, 0.1, 0.3, 1.0, 3.0)
"""Variance of the curve over that of the errors."""


def likelier(values: FloatArray, y: FloatArray) -> float:
    """Log marginal likelihood of a smooth curve over `values` (n,) less that of none; the best of a grid.

    The scale of the errors is integrated out; the curve is a sum of cosines with the spectrum of a squared exponential.
    """
    n, spread = len(y), float(np.ptp(values))
    if spread == 0.0:
        return 0.0
    u = (values - values.min()) / spread
    k = np.arange(1, WAVES + 1)
    waves = np.sqrt(2.0) * np.cos(np.pi * np.outer(u, k))
    waves -= waves.mean(axis=0)
    centred = y - y.mean()
    gram, dot, square = waves.T @ waves, waves.T @ centred, float(centred @ centred)
    best = 0.0
    for length in LENGTHS:
        spectrum = np.exp(-0.5 * (np.pi * k * length) ** 2)
        spectrum /= spectrum.sum()
        scale = np.sqrt(spectrum)
        values2, vectors = np.linalg.eigh(gram * np.outer(scale, scale))
        turned = (vectors.T @ (scale * dot)) ** 2
        for amplitude in AMPLITUDES:
            grown = 1.0 + amplitude * np.maximum(values2, 0.0)
            left = square - float(np.sum(amplitude * turned / grown))
            gain = -0.5 * float(np.sum(np.log(grown))) - 0.5 * n * float(np.log(max(left, 1e-12 * square) / square))
            best = max(best, gain)
    return best
