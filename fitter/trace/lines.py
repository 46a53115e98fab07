"""Periods of a residual, in the order of the readings or in time.

Mains hum that beats with the readings, an air conditioner or a pump follow no setting. The power at each frequency is
compared with the power at its neighbours, so that noise with memory, which has more power at low frequencies, is not a
line. A line with a wandering phase is spread over a few frequencies, so sums of three are tried too, and sums over
stretches between pauses.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import special

from fitter.arrays import FloatArray, IntArray

ABOUT = 20
"""Number of frequencies on each side for the comparison of power."""
SLOWEST = 8
"""Minimum number of periods in the series: a slower variation is a drift along the run and not a line."""
LEAST_KEPT = 0.3
"""Minimum remaining share of the power of white noise, relative to the usual share, for a search at a frequency."""
FEWEST = 96
"""Minimum number of readings for a search."""
CLEAR = 1e-4
"""Probability below which there is a period: the usual power about its frequency is known from a few dozen numbers."""
IN_TIME = 600
"""Maximum number of tried frequencies in time."""


@dataclass(frozen=True)
class Line:
    """The clearest period of a series.

    Attributes:
        period: in readings or in seconds.
        unit: "readings" or "s".
        p: probability of such a clear line by chance, over all tried frequencies.
        share: its share of the sum of squares.

    """

    period: float
    unit: str
    p: float
    share: float

    @property
    def where(self) -> str:
        """In words."""
        if self.unit == "readings":
            return f"along the run: periodic, one period in {self.period:.4g} readings"
        return f"along the run: periodic, one period in {self.period / 60.0:.4g} min"


def line(left: FloatArray, elapsed_s: FloatArray, stretch: IntArray, white: FloatArray | None = None) -> Line | None:
    """The clearest period of a residual, in order or in time; None where there are too few readings.

    Args:
        left: (n,) residual in the order of running.
        elapsed_s: (n,) time of each.
        stretch: (n,) readings without a pause between them have the same number.
        white: (n, m) draws of white noise after the projection of the residual, in its order: a projection that
            removes much at some frequencies would make the others significant. None if it removes nearly nothing.

    """
    if left.size < FEWEST or not np.any(left):
        return None
    white = np.ones((left.size, 0)) if white is None else white
    found = [_in_order(left, stretch, white)]
    if np.ptp(elapsed_s) > 0:
        found.append(_in_time(left, elapsed_s, white))
    best = min(found, key=lambda one: one.p)
    return Line(best.period, best.unit, min(len(found) * best.p, 1.0), best.share)


def _in_order(left: FloatArray, stretch: IntArray, white: FloatArray) -> Line:
    n, total = left.size, float(left @ left)
    power = np.abs(np.fft.rfft(left)) ** 2
    whole = _clearest(power[1:], 1, _kept(np.abs(np.fft.rfft(white, axis=0)[1:]) ** 2))
    out = Line(n / (whole[0] + 1.0), "readings", 3 * whole[1], min(2 * whole[2] / (n * total), 1.0))
    parts = [left[stretch == one] for one in np.unique(stretch)]
    parts = [part for part in parts if part.size >= FEWEST]
    if len(parts) > 1:
        length = max(part.size for part in parts)
        summed = sum((np.abs(np.fft.rfft(part, length)) ** 2 for part in parts), np.zeros(length // 2 + 1))
        drawn = [white[stretch == one] for one in np.unique(stretch)]
        known = sum((np.abs(np.fft.rfft(one, length, axis=0)[1:]) ** 2 for one in drawn if len(one) >= FEWEST), 0.0)
        each = _clearest(summed[1:], len(parts), _kept(np.asarray(known)))
        if 3 * each[1] < out.p:
            out = Line(length / (each[0] + 1.0), "readings", 3 * each[1], min(2 * each[2] / (length * total), 1.0))
    return out


def _in_time(left: FloatArray, elapsed_s: FloatArray, white: FloatArray) -> Line:
    n, length = left.size, float(np.ptp(elapsed_s)) * left.size / (left.size - 1)
    cycles = np.arange(1, min(n // 2, IN_TIME) + 1)
    turns = (elapsed_s - elapsed_s[0]) / length
    power, known = np.empty(cycles.size), np.empty((cycles.size, white.shape[1]))
    for first in range(0, cycles.size, 64):
        angle = 2 * np.pi * np.outer(cycles[first : first + 64], turns)
        cos, sin = np.cos(angle), np.sin(angle)
        power[first : first + 64] = (cos @ left) ** 2 + (sin @ left) ** 2
        known[first : first + 64] = (cos @ white) ** 2 + (sin @ white) ** 2
    at, p, value = _clearest(power, 1, _kept(known))
    return Line(length / (at + 1.0), "s", p, min(2 * value / (n * float(left @ left)), 1.0))


def _kept(known: FloatArray) -> FloatArray | None:
    """(m,) share of the power at each frequency that a projection leaves, from draws (m, k); None without draws."""
    if not known.shape[1]:
        return None
    mean = known.mean(axis=1)
    return np.asarray(mean / max(float(np.median(mean)), np.finfo(float).tiny))


def _clearest(power: FloatArray, summed: int, kept: FloatArray | None = None) -> tuple[float, float, float]:
    """Index of the clearest line, p over all frequencies, and its power.

    Args:
        power: (m,) of each frequency.
        summed: number of independent series in the sum.
        kept: (m,) remaining share of the power of white noise at each; None if all of it remains everywhere.

    """
    best = (0.0, 1.0, 0.0)
    if kept is not None:
        power = np.where(kept > LEAST_KEPT, power / np.maximum(kept, LEAST_KEPT), 0.0)
    for width in (1, 3):
        if power.size < 3 * width + ABOUT:
            continue
        sums = np.convolve(power, np.ones(width), "valid")
        typical = _typical(power, summed) * width
        typical = typical[width // 2 : power.size - width // 2]
        nu, below = 2.0 * summed * width, float(ABOUT * summed)
        p = special.fdtrc(nu, below, sums / typical) * power.size * 2
        at = int(np.argmin(p))
        if p[at] < best[1]:
            best = (at + width // 2, float(p[at]), float(sums[at]))
    return best


def _typical(power: FloatArray, summed: int) -> FloatArray:
    """(m,) mean power about each frequency, by the larger of the medians below it and above it."""
    over = float(special.gammaincinv(summed, 0.5)) / summed  # the median of a gamma over its mean
    m, out = power.size, np.full(power.size, np.inf)
    medians = np.median(np.lib.stride_tricks.sliding_window_view(power, ABOUT), axis=1)  # of k to k + ABOUT - 1
    at = np.arange(SLOWEST - 1, m)
    below = np.array([np.median(power[:k]) for k in range(SLOWEST - 1, min(ABOUT, m))])
    below = np.concatenate([below, medians[: max(m - ABOUT, 0)]])
    above = np.where(at + ABOUT < m, medians[np.minimum(at + 1, medians.size - 1)], 0.0)
    out[at] = np.maximum(np.maximum(below, above) / over, np.finfo(float).tiny)
    return out
