"""The step that values were rounded to, and standard deviations that know of it.

Rounded values repeat. A quantile of their residuals is then the residual of one repeated value, often zero, and says
nothing of the scatter. Here every residual counts as spread over the width of its step; what that adds to the variance,
step^2 / 12 (W. F. Sheppard, Proc. London Math. Soc. 29 (1898) 353), is taken off again. No standard deviation of
rounded values is below step / sqrt(12).
"""

from __future__ import annotations

import numpy as np
from scipy import special

from fitter.arrays import FloatArray

DECIMALS = range(-6, 16)
LARGEST = 2.0**50
"""Whole numbers up to this are exact in a double, with some room for rounding errors."""
TIED = 0.5
"""Values that take fewer different ones than this share of them may lie on a lattice that is not decimal."""
BISECTIONS = 60


def resolution(values: FloatArray) -> float:
    """The step that values (n,) were rounded to, in their unit; zero where none is seen.

    Decimal steps are read off the digits (0.01, 0.05), other ones, such as a converter's, off values that repeat.
    """
    distinct = np.unique(values[np.isfinite(values)])
    if distinct.size < 2:
        return 0.0
    decimal = _decimal(distinct)
    if distinct.size > TIED * values.size:
        return decimal
    gaps = np.diff(distinct)
    least = float(gaps.min())
    # written values of another step are each off by half a digit
    tolerance = max(1e-6, 1.5 * decimal / least)
    on_lattice = tolerance < 0.2 and bool(np.all(np.abs(gaps / least - np.round(gaps / least)) <= tolerance))
    return least if on_lattice else decimal


def _decimal(distinct: FloatArray) -> float:
    largest = float(np.max(np.abs(distinct)))
    for places in DECIMALS:
        scaled = distinct * 10.0**places
        if largest * 10.0**places > LARGEST:
            return 0.0
        whole = np.round(scaled)
        if np.all(np.abs(scaled - whole) <= 4.0 * np.finfo(float).eps * np.abs(scaled)):
            return float(np.gcd.reduce(np.diff(whole).astype(np.int64)) * 10.0**-places)
    return 0.0


def least_sd(step: float | FloatArray) -> float:
    """Standard deviation of rounding to `step` alone; of rows with different steps the root mean square."""
    return float(np.sqrt(np.mean(np.square(step)) / 12.0))


def robust_sd(residual: FloatArray, step: float | FloatArray = 0.0, inside: float = 0.5) -> float:
    """Standard deviation of normal errors by a quantile of their sizes, which a few gross errors do not move.

    Args:
        residual: (n,) about zero.
        step: that the values were rounded to, in the unit of the residual; one, or (n,).
        inside: share of the residuals that the quantile is of; 0.5 is the median absolute deviation.

    """
    size = np.abs(residual)
    normal = special.ndtri(0.5 + 0.5 * inside)
    if not np.any(step):
        return float(np.quantile(size, inside) / normal)
    half = np.broadcast_to(0.5 * np.asarray(step, np.float64), size.shape)
    low, high = 0.0, float(np.max(size + half))
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        if _share_inside(middle, size, half) < inside:
            low = middle
        else:
            high = middle
    floor = least_sd(step)
    return float(np.sqrt(max((high / normal) ** 2 - floor**2, floor**2)))


def _share_inside(limit: float, size: FloatArray, half: FloatArray) -> float:
    """Share of residuals, each spread evenly over its step, that lie between -limit and limit."""
    with np.errstate(divide="ignore", invalid="ignore"):
        covered = np.minimum(limit, size + half) - np.maximum(-limit, size - half)
        spread = np.where(half > 0, np.clip(covered / (2.0 * half), 0.0, 1.0), size <= limit)
    return float(np.mean(spread))
