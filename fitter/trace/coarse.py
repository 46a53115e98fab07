"""Readings that are whole multiples of a coarse step: of one person, one range, one instrument.

A needle read to whole divisions leaves a lattice in the values. Its step is searched by the spectrum of the
values' histogram, whose peak is at one over the step, and refined by least squares. By chance a row lies on a lattice
with the probability of its printed width; the number that does is binomial.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import special

from rig.fitter import ties
from rig.fitter.arrays import FloatArray

LEAST, MOST = 0.7, 15.0
"""Searched steps, over the standard error of a row."""
FEWEST = 10
"""Rows, from which on a lattice is searched in them."""
BINS = 8.0
"""Bins of the histogram to the smallest step."""
PADDED = 4
LARGEST = 2**21
"""Maximum length of the spectrum; values over a longer range are not searched."""
PEAKS, ROUNDS = 12, 6
INSIDE = 0.75
"""Distance from the lattice, in printed steps, up to which a value is on it."""
SAME_ROWS = 0.97
"""Share of the most rows on any lattice, from which on a larger step explains as much."""
CORE = 0.8
"""Maximum density of the errors of rows, times their standard deviation; a normal one has 0.4, long tails more."""


@dataclass(frozen=True)
class Lattice:
    """A coarse step of values.

    Attributes:
        step: in the unit of the values.
        rows: number of rows on it.
        p: probability of as many by chance, over all searched steps.

    """

    step: float
    rows: int
    p: float


def lattice(values: FloatArray, printed: float, sd: float) -> Lattice | None:
    """The lattice on which most `values` (n,) lie; None if there is none to be seen.

    Args:
        values: readings.
        printed: rounding step of their digits, in their unit.
        sd: standard error of a row, in their unit.
    """
    n, span = values.size, float(np.ptp(values))
    least = max(LEAST * sd, 6.0 * printed)
    if n < FEWEST or printed <= 0.0 or least >= MOST * sd or span < least:
        return None
    width = least / BINS
    length = int(2 ** np.ceil(np.log2(PADDED * (span / width + 1.0))))
    if length > LARGEST:
        return None
    counts = np.bincount(((values - values.min()) / width).astype(np.int64), minlength=1).astype(np.float64)
    power = np.abs(np.fft.rfft(counts, length))
    frequency = np.arange(power.size) / (length * width)
    wanted = (frequency >= 1.0 / (MOST * sd)) & (frequency <= 1.0 / least)
    tried = int(np.sum(wanted))
    if tried < 1:
        return None
    order = np.flatnonzero(wanted)[ties.descending(power[wanted], float(np.max(power)))]
    found = [_refined(values, 1.0 / float(frequency[k]), printed, sd, tried) for k in _apart(order)]
    # a step's half, third, two thirds hold all of its rows as well
    full = max(one.rows for one in found)
    best = max((one for one in found if one.rows >= SAME_ROWS * full), key=lambda one: (one.p < 0.5, one.step))
    return best if least <= best.step <= 2.0 * MOST * sd else None


def _apart(order: np.ndarray) -> list[int]:
    """The first peaks that are not neighbours."""
    peaks: list[int] = []
    for k in order[: PEAKS * 20].tolist():
        if all(abs(k - other) > PADDED for other in peaks):
            peaks.append(k)
        if len(peaks) == PEAKS:
            break
    return peaks


def _refined(values: FloatArray, step: float, printed: float, sd: float, tried: int) -> Lattice:
    start = float(np.angle(np.sum(np.exp(2j * np.pi * (values - values.min()) / step)))) / (2.0 * np.pi) * step
    first = float(values.min()) + start
    on = np.ones(values.size, np.bool_)
    for _ in range(ROUNDS):
        whole = np.round((values - first) / step)
        if np.ptp(whole[on]) == 0:
            break
        step, first = np.polyfit(whole[on], values[on], 1).tolist()
        off = np.abs(values - first - step * np.round((values - first) / step))
        near = off <= max(float(np.median(off)) * 3.0, INSIDE * printed)
        on = near if np.sum(near) > 2 else on
        if step <= 0.0:
            return Lattice(0.0, 0, 1.0)
    off = np.abs(values - first - step * np.round((values - first) / step))
    rows = int(np.sum(off <= INSIDE * printed * (1.0 + 1e-6)))
    inside = min((2.0 * INSIDE + 1.0) * printed * max(1.0 / step, CORE / sd), 1.0)
    by_chance = float(special.bdtrc(rows - 3, max(values.size - 2, 1), inside)) if rows > 2 else 1.0
    return Lattice(step, rows, min(by_chance * tried * max(step / printed, 1.0), 1.0))
