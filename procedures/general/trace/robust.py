"""Isolated outliers: reduced during the search for effects, so that a few neither create nor mask one."""

from __future__ import annotations

import numpy as np

from fitter.arrays import FloatArray, IntArray
from fitter.resolution import robust_sd

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


def excess(left: FloatArray, *, ordered: bool, step: FloatArray | float = 0.0) -> FloatArray:
    """(n,) reduction of isolated residuals (n,), over each row's sd; zero for all others.

    A reading is isolated only if it deviates from the model and, if the order of measurement is known, from its
    neighbours too: a level common to several readings is an effect. `step` is the rounding step of the values, one or
    (n,), in the unit of the residual.
    """
    if len(left) < FEWEST:
        return np.zeros_like(left)
    off = _beyond(left, step)
    if ordered and len(left) > 4 * NEIGHBOURS:
        local = _beyond(left - running_median(left), step)
        off = np.where(np.abs(local) < np.abs(off), local, off)
    return off


def scale(left: FloatArray, step: FloatArray | float = 0.0) -> float:
    """Standard deviation by the median of absolute values, at least a fifth of the rms and that of rounding."""
    return float(max(robust_sd(left, step), 0.2 * np.sqrt(np.mean(left**2))))


def apart_from(left: FloatArray, off: FloatArray, near: IntArray, step: FloatArray | float = 0.0) -> FloatArray:
    """(n,) `off`, the reduction of isolated residuals (n,), where these are as far from rows (n, k) `near` to them.

    Those have about the same settings: readings that deviate together with them are a shape, such as a peak.
    """
    apart = np.abs(left - np.median(left[near], axis=1))
    return np.where(apart > _alone(len(left)) * scale(left, step), off, 0.0)


def running_median(values: FloatArray) -> FloatArray:
    """(n,) median of each value and its neighbours."""
    padded = np.pad(values, NEIGHBOURS, mode="reflect")
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * NEIGHBOURS + 1)
    return np.asarray(np.median(windows, axis=1))


def _beyond(deviation: FloatArray, step: FloatArray | float) -> FloatArray:
    """Part of each deviation beyond `HELD`, for those beyond `ALONE`."""
    sd = scale(deviation, step)
    held = np.clip(deviation, -HELD * sd, HELD * sd)
    return np.where(np.abs(deviation) > _alone(len(deviation)) * sd, deviation - held, 0.0)


def _alone(rows: int) -> float:
    """Robust standard deviations from which on a deviation of so many rows is isolated."""
    return ALONE * (1.0 + FEW / rows)
