"""The rounding step of values, and standard deviations that take it into account.

Rounded values repeat. A quantile of their residuals is then the residual of one repeated value, often zero, and has no
information about the scatter. Here every residual is distributed evenly over its step. The added variance, step^2 / 12
(W. F. Sheppard, Proc. London Math. Soc. 29 (1898) 353), is subtracted again. No standard deviation of rounded values is
below step / sqrt(12).
"""

from __future__ import annotations

import math
from bisect import bisect_left

import numpy as np
from scipy import special

from rig.fitter.arrays import FloatArray

DECIMALS = range(-6, 16)
LARGEST = 2.0**50
"""Integers up to this are exact in a double, with a margin for rounding errors."""
TIED = 0.5
"""If the number of different values is below this share of all, they may lie on a lattice that is not decimal."""


def resolution(values: FloatArray) -> float:
    """The rounding step of values (n,), in their unit; zero if none is detected.

    Decimal steps are recognised by the digits (0.01, 0.05), others, such as a converter's, by repeated values.
    """
    distinct = np.unique(values[np.isfinite(values)])
    if distinct.size < 2:
        return 0.0
    decimal = _decimal(distinct)
    if distinct.size > TIED * values.size:
        return decimal
    gaps = np.diff(distinct)
    least = float(gaps.min())
    # values printed with another step deviate by up to half a digit
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
    """Standard deviation of rounding to `step` alone; for rows with different steps the root mean square."""
    return float(np.sqrt(np.mean(np.square(step)) / 12.0))


def robust_sd(residual: FloatArray, step: float | FloatArray = 0.0, inside: float = 0.5) -> float:
    """Standard deviation of normal errors by a quantile of their sizes, insensitive to a few gross errors.

    Args:
        residual: (n,) about zero.
        step: rounding step of the values, in the unit of the residual; one, or (n,).
        inside: probability of the quantile; 0.5 gives the median absolute deviation.
    """
    size = np.abs(residual)
    if not np.any(step):
        return float(np.quantile(size, inside) / _of_normal(inside))
    half = np.broadcast_to(0.5 * np.asarray(step, np.float64), size.shape)
    return _without_rounding(_limit(size, half, inside), step, inside)


def least_robust_sd(residual: FloatArray, step: float | FloatArray = 0.0) -> float:
    """What `robust_sd` is at least, in a small part of its time: every residual at the near end of its step."""
    starts = np.abs(residual) - 0.5 * np.asarray(step, np.float64)
    count = math.ceil(0.5 * starts.size) - 1
    return _without_rounding(max(float(np.partition(starts, count)[count]), 0.0), step, 0.5)


def _of_normal(inside: float) -> float:
    return float(special.ndtri(0.5 + 0.5 * inside))


def _without_rounding(limit: float, step: float | FloatArray, inside: float) -> float:
    """Standard deviation by the limit of a share of the residuals, less that of rounding and not below it."""
    floor = least_sd(step)
    return float(np.sqrt(max((limit / _of_normal(inside)) ** 2 - floor**2, floor**2)))


def _limit(size: FloatArray, half: FloatArray, inside: float) -> float:
    """Least limit within which is a share of residuals of these sizes, each distributed evenly over `half` either way.

    The share grows linearly between the ends of intervals. All but few rows are inside as a whole, or outside.
    """
    n, starts, ends = size.size, size - half, size + half
    count = min(math.ceil(inside * n), n) - 1
    low, high = max(float(np.partition(starts, count)[count]), 0.0), float(ends.max())
    tried = float(np.partition(ends, min(count + 1, n - 1))[min(count + 1, n - 1)])
    if np.mean(_inside(tried, starts, ends, half)) >= inside:
        high = tried
    whole = float(np.sum(_inside(high, starts, ends, half)[ends <= low]))
    part = (starts < high) & (ends > low)
    starts, ends, half = starts[part], ends[part], half[part]

    def share(limit: float) -> float:
        return (whole + float(np.sum(_inside(limit, starts, ends, half)))) / n

    kinks = np.sort(np.concatenate([[low, high], np.clip(np.abs(starts), low, high), np.clip(ends, low, high)]))
    above = bisect_left(kinks, inside, key=share)
    if above in (0, kinks.size):
        return float(kinks[0] if above == 0 else high)
    first, last = share(kinks[above - 1]), share(kinks[above])
    return float(kinks[above - 1] + (inside - first) / (last - first) * (kinks[above] - kinks[above - 1]))


def _inside(limit: float, starts: FloatArray, ends: FloatArray, half: FloatArray) -> FloatArray:
    """Share of each residual, distributed evenly from its start to its end, between -limit and limit."""
    covered = np.minimum(limit, ends) - np.maximum(-limit, starts)
    return np.minimum(np.maximum(covered / (2.0 * half), 0.0), 1.0)  # `np.clip` takes twice as long for few rows
