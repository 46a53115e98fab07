"""Readings that stand alone: held back while effects are looked for, so that a few neither make nor hide one."""

from __future__ import annotations

import numpy as np

from fitter.arrays import FloatArray
from fitter.resolution import robust_sd

ALONE = 4.5
"""Robust standard deviations from which a reading counts as standing alone."""
FEW = 8.0
"""Rows at which the limit is twice as high: a few rows do not tell their scale well."""
HELD = 3.0
"""Standard deviations it is brought back to."""
NEIGHBOURS = 3
"""On either side, of the running median that a reading of an ordered table also has to stand out from."""
FEWEST = 15


def excess(left: FloatArray, *, ordered: bool, step: FloatArray | float = 0.0) -> FloatArray:
    """(n,) what is taken off a residual (n,), over each row's sd, that stands alone; zero for all others.

    A reading stands alone only if it stands out from the model and, where the order of taking is known, from its
    neighbours too: a level that several readings hold is an effect. `step` is what the values were rounded to, one or
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
    """Standard deviation by the median of absolute values, not below a fifth of the rms, nor what rounding gives."""
    return float(max(robust_sd(left, step), 0.2 * np.sqrt(np.mean(left**2))))


def running_median(values: FloatArray) -> FloatArray:
    """(n,) median of each value and its neighbours."""
    padded = np.pad(values, NEIGHBOURS, mode="reflect")
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * NEIGHBOURS + 1)
    return np.asarray(np.median(windows, axis=1))


def _beyond(deviation: FloatArray, step: FloatArray | float) -> FloatArray:
    """What of each deviation is beyond `HELD`, where it is beyond `ALONE`."""
    sd = scale(deviation, step)
    limit = ALONE * (1.0 + FEW / len(deviation)) * sd
    held = np.clip(deviation, -HELD * sd, HELD * sd)
    return np.where(np.abs(deviation) > limit, deviation - held, 0.0)
