"""Isolated outliers: reduced during the search for effects, so that a few neither create nor mask one."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.resolution import least_robust_sd, robust_sd

ALONE = 4.5
"""Robust standard deviations from which a reading counts as isolated."""
FEW = 8.0
"""Number of rows at which the limit is doubled: few rows do not determine their scale well."""
HELD = 3.0
"""Standard deviations to which it is reduced."""
NEIGHBOURS = 3
"""Number of neighbours on either side for the running median from which a reading of an ordered table must also
deviate.
"""
FEWEST = 15


def excess(
    left: FloatArray,
    *,
    ordered: bool,
    step: FloatArray | float = 0.0,
    near: Callable[[], IntArray | None] = lambda: None,
) -> FloatArray:
    """(n,) reduction of isolated residuals (n,), over each row's sd; zero for all others.

    A reading is isolated only if it deviates from the model and, if the order of measurement is known, from its
    neighbours too: a level common to several readings is an effect. So is one that deviates together with the rows
    (n, k) `near` it, which have about the same settings: they are a shape, such as a peak. Where none deviates, `near`
    is not asked. `step` is the rounding step of the values, one or (n,), in the unit of the residual.
    """
    if len(left) < FEWEST or np.max(np.abs(left)) <= _limit(len(left)) * _at_least(left, least_robust_sd(left, step)):
        return np.zeros_like(left)  # most calls: a lower limit of the scale takes a small part of its time
    off, limit = _beyond(left, step)
    if not np.any(off):
        return off
    if ordered and len(left) > 4 * NEIGHBOURS:
        local, _ = _beyond(left - running_median(left), step)
        off = np.where(np.abs(local) < np.abs(off), local, off)
    around = near()
    if around is not None:
        rows = np.flatnonzero(off)
        off[rows[np.abs(left[rows] - np.median(left[around[rows]], axis=1)) <= limit]] = 0.0
    return off


def scale(left: FloatArray, step: FloatArray | float = 0.0) -> float:
    """Standard deviation by the median of absolute values, at least a fifth of the rms and that of rounding."""
    return _at_least(left, robust_sd(left, step))


def _at_least(left: FloatArray, sd: float) -> float:
    return float(max(sd, 0.2 * np.sqrt(np.mean(left**2))))


def _limit(n: int) -> float:
    """Standard deviations from which one of n readings is isolated."""
    return ALONE * (1.0 + FEW / n)


def running_median(values: FloatArray) -> FloatArray:
    """(n,) median of each value and its neighbours."""
    padded = np.pad(values, NEIGHBOURS, mode="reflect")
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * NEIGHBOURS + 1)
    return np.asarray(np.partition(windows, NEIGHBOURS, axis=1)[:, NEIGHBOURS])


def _beyond(deviation: FloatArray, step: FloatArray | float) -> tuple[FloatArray, float]:
    """Part of each deviation beyond `HELD`, for those beyond `ALONE`; and the size from which on these are isolated."""
    sd = scale(deviation, step)
    held, limit = np.clip(deviation, -HELD * sd, HELD * sd), _limit(len(deviation)) * sd
    return np.where(np.abs(deviation) > limit, deviation - held, 0.0), limit
