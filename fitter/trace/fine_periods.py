"""Fine periods over a variable that took many different values: a screw's pitch, an encoder's lines, a drive's waves.

Values that are never visited twice tell hundreds and thousands of periods over their range, as many as their digits
resolve. Their spectrum is that of the residual put on a fine grid (Press and Rybicki, Astrophys. J. 338 (1989) 277).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rig.fitter import ties
from rig.fitter.arrays import FloatArray
from rig.fitter.resolution import resolution
from rig.fitter.trace.flexible import Block, Remainder, turns
from rig.fitter.trace.lines import Line, folded

HARMONICS = 3
ORDERS = (2, 2 * HARMONICS)
"""Numbers of columns that are asked together: a sine, and one with its overtones."""
FEWEST = 64
"""Rows, and different values, at least."""
SLOWEST = 7
"""Periods over the range, at least: slower ones are smooth curves."""
MOST = 8192
"""The same, at most."""
CELLS = 1 << 16
"""Cells over the range; a period of `MOST` has eight."""
FINE = 2
"""Frequencies that are tried for each one that the range tells apart."""
LIKELIEST = 3
"""Periods that are asked about, of a sine and of one with overtones each."""


def fine_period(
    left: FloatArray, at: FloatArray, over: str, ask: Callable[[Block], Remainder | None], unit: str = ""
) -> Line | None:
    """The clearest fine period of a residual over a variable; None where its values tell none.

    Args:
        left: (n,) residual, in whatever weights show the period best.
        at: (n,) values of the variable.
        over: its name.
        ask: the remainder at a block of columns (n, m) of a wave and its overtones.
        unit: of the variable.
    """
    span = float(np.ptp(at))
    if span <= 0.0 or np.unique(at).size < FEWEST:
        return None
    step = resolution(at)
    fastest = int(min(MOST, span / (2.0 * step) if step > 0.0 else MOST))
    if fastest < 2 * SLOWEST:
        return None
    cells = np.bincount(((at - at.min()) / span * (CELLS - 1)).astype(np.int64), left, minlength=FINE * CELLS)
    power = np.abs(np.fft.rfft(cells)) ** 2
    tried = np.arange(FINE * SLOWEST, FINE * fastest + 1)
    overtones = sum(power[np.minimum(k * tried, power.size - 1)] for k in range(1, HARMONICS + 1))
    each = (ties.top(np.asarray(one), LIKELIEST) for one in (power[tried], overtones))
    count, best = len(ORDERS) * tried.size, None
    for k in sorted(set(np.concatenate(list(each)).tolist())):
        period, phase = folded(left, at, FINE * span * CELLS / (CELLS - 1) / float(tried[k]))
        columns = turns(360.0 * phase / period, HARMONICS)
        one = ask(Block(f"over {over}", columns, ORDERS, np.repeat(np.arange(1.0, HARMONICS + 1), 2)))
        if one is not None and (best is None or ties.below(one.p * count, best.p, 0.0)):
            best = Line(period, unit, min(one.p * count, 1.0), one.share, over)
    return best
