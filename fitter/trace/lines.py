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

from rig.fitter import ties
from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.trace.flexible import Block, rough_turns, turns
from rig.fitter.trace.shape import Axis

ABOUT = 20
"""Number of frequencies on each side for the comparison of power."""
SLOWEST = 8
"""Minimum number of periods in the series: a slower variation is a drift along the run and not a line."""
LEAST_KEPT = 0.3
"""Minimum remaining share of the power of white noise, relative to the usual share, for a search at a frequency."""
NOTHING = 1e-9
"""Share of the largest below which nothing remains."""
FEWEST = 96
"""Minimum number of readings for a search."""
CLEAR = 1e-4
"""Probability below which there is a period: the usual power about its frequency is known from a few dozen numbers."""
NEAR, TRIED = 3.0, 61
"""Periods over the series about a line within which its period is placed, and how many are tried."""
IN_TIME = 600
"""Maximum number of tried frequencies in time."""
AT_ONCE = 32
"""Frequencies whose waves are computed together, from those of the ones before."""
PAUSED = 1.5
"""Frequencies up to one period in two usual waits, over those of half as many as readings, from which readings have
pauses between them that hide what is faster than these."""
PERIODS = 1.25
"""In a stretch between two pauses, at least."""
IN_PAUSES, ABOUT_PAUSES = 2400, 40
"""The same as `IN_TIME`, and as `ABOUT`, of readings with pauses."""


@dataclass(frozen=True)
class Line:
    """The clearest period of a series.

    Attributes:
        period: in readings, in seconds, or in the unit of a variable.
        unit: "readings", "s", or that of the variable.
        p: probability of such a clear line by chance, over all tried frequencies.
        share: its share of the sum of squares.
        over: the variable; "" for the run.

    """

    period: float
    unit: str
    p: float
    share: float
    over: str = ""

    @property
    def where(self) -> str:
        """In words."""
        if self.over:
            return f"over {self.over}: periodic, one period in {self.period:.5g} {self.unit}".rstrip()
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
    return lines(left[None], elapsed_s, stretch, white)[0]


def lines(
    left: FloatArray, elapsed_s: FloatArray, stretch: IntArray, white: FloatArray | None = None
) -> list[Line | None]:
    """`line` of each of several residuals (S, n) after one projection."""
    out = list[Line | None]([None] * len(left))
    able = [i for i, one in enumerate(left) if one.size >= FEWEST and np.any(one)]
    if not able:
        return out
    white = np.ones((left.shape[1], 0)) if white is None else white
    in_time = _in_time(left[able], elapsed_s, white) if np.ptp(elapsed_s) > 0 else [None] * len(able)
    for i, timed in zip(able, in_time, strict=True):
        found = [_in_order(left[i], stretch, white)]
        if timed is not None:
            found.append(timed)
            fastest = _fastest(elapsed_s)
            if fastest > PAUSED * left[i].size / 2 and not white.shape[1]:
                found.append(_between_pauses(left[i], elapsed_s, range(_slowest(elapsed_s, stretch), fastest + 1)))
        best = ties.least(found, key=lambda one: one.p)
        out[i] = Line(best.period, best.unit, min(len(found) * best.p, 1.0), best.share)
    return out


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
        if ties.below(3 * each[1], out.p, 0.0):
            out = Line(length / (each[0] + 1.0), "readings", 3 * each[1], min(2 * each[2] / (length * total), 1.0))
    return out


def _in_time(left: FloatArray, elapsed_s: FloatArray, white: FloatArray) -> list[Line]:
    """The clearest period of each of residuals (S, n)."""
    count, n = left.shape
    length = float(np.ptp(elapsed_s)) * n / (n - 1)
    cycles = np.arange(1, min(n // 2, IN_TIME) + 1)
    turns = (elapsed_s - elapsed_s[0]) / length
    series = np.column_stack([*left, white])
    power = np.empty((cycles.size, series.shape[1]))
    waves = np.exp(2j * np.pi * np.outer(cycles[:AT_ONCE], turns))
    turned = np.exp(2j * np.pi * AT_ONCE * turns)
    for first in range(0, cycles.size, AT_ONCE):
        waves = waves[: cycles.size - first]
        power[first : first + AT_ONCE] = (waves.real @ series) ** 2 + (waves.imag @ series) ** 2
        waves *= turned
    kept = _kept(power[:, count:])
    found = [_clearest(np.ascontiguousarray(one), 1, kept) for one in power[:, :count].T]
    every = zip(left, found, strict=True)
    return [
        Line(length / (at + 1.0), "s", p, min(2 * value / (n * float(one @ one)), 1.0)) for one, (at, p, value) in every
    ]


def _fastest(elapsed_s: FloatArray) -> int:
    """Cycles over the series of one period in two usual waits."""
    wait = float(np.median(np.diff(np.sort(elapsed_s))))
    return int(np.ptp(elapsed_s) / (2.0 * wait)) if wait > 0 else 0


def _slowest(elapsed_s: FloatArray, stretch: IntArray) -> int:
    """Cycles over the series of `PERIODS` in a usual stretch: what is slower is a course along it."""
    lasts = float(np.median([np.ptp(elapsed_s[stretch == one]) for one in np.unique(stretch)]))
    return max(int(np.ceil(PERIODS * np.ptp(elapsed_s) / lasts)) if lasts > 0 else SLOWEST, SLOWEST)


def _between_pauses(left: FloatArray, elapsed_s: FloatArray, tried: range) -> Line:
    """The clearest period in time where pauses spread each over many frequencies.

    It is compared with the power about it of what is left without it.
    """
    length = float(np.ptp(elapsed_s))
    turns = (elapsed_s - elapsed_s[0]) / length
    cycles = np.array(tried[: IN_PAUSES + 1])
    if cycles.size < 2 * ABOUT_PAUSES:
        return Line(length, "s", 1.0, 0.0)

    def waves_of(some: IntArray) -> FloatArray:
        angle = 2 * np.pi * np.outer(some, turns)
        return np.stack([np.cos(angle), np.sin(angle)])

    def power_of(series: FloatArray, some: IntArray) -> FloatArray:
        parts = [waves_of(some[k : k + 64]) @ series for k in range(0, some.size, 64)]
        return np.asarray(np.sum(np.concatenate(parts, axis=1) ** 2, axis=0))

    power = power_of(left, cycles)
    at = ties.highest(power, float(np.max(power)))
    own = waves_of(cycles[at : at + 1])[:, 0].T
    held = own @ np.linalg.lstsq(own, left, rcond=None)[0]
    about = cycles[max(at - ABOUT_PAUSES, 0) : at + ABOUT_PAUSES + 1]
    noise = power_of(left - held, about[np.abs(about - cycles[at]) > 1])
    typical = float(np.median(noise)) / np.log(2.0)
    middle = max(typical, float(np.mean(noise)), np.finfo(float).tiny)
    p = float(special.fdtrc(2.0, float(noise.size), float(power[at]) / middle)) * 2.0 * cycles.size
    share = float(held @ held) / float(left @ left)
    return Line(length / float(cycles[at]), "s", min(p, 1.0), share)


def _kept(known: FloatArray) -> FloatArray | None:
    """(m,) share of the power at each frequency that a projection leaves, from draws (m, k); None without draws."""
    if not known.shape[1]:
        return None
    mean = known.mean(axis=1)
    some = mean > NOTHING * np.max(mean)
    return np.asarray(mean / np.median(mean[some])) if some.any() else np.zeros_like(mean)


def _clearest(power: FloatArray, summed: int, kept: FloatArray | None = None) -> tuple[float, float, float]:
    """Index of the clearest line, p over all frequencies, and its power.

    Args:
        power: (m,) of each frequency.
        summed: number of independent series in the sum.
        kept: (m,) remaining share of the power of white noise at each; None if all of it remains everywhere.

    """
    best = (0.0, 1.0, 0.0)
    # where little remains is no neighbour either: replications that walk one path leave nothing at every second
    # frequency, or third, and the others would stand out
    used = np.arange(power.size) if kept is None else np.flatnonzero(kept > LEAST_KEPT)
    power = power[used] if kept is None else power[used] / kept[used]
    first = max(int(np.searchsorted(used, SLOWEST - 1)), 1)
    for width in (1, 3):
        if power.size < max(3 * width + ABOUT, first + 2):
            continue
        sums = np.convolve(power, np.ones(width), "valid")
        typical = _typical(power, summed, first) * width
        typical = typical[width // 2 : power.size - width // 2]
        nu, below = 2.0 * summed * width, float(ABOUT * summed)
        p = special.fdtrc(nu, below, sums / typical) * power.size * 2
        at = ties.lowest(p, 0.0)
        if ties.below(float(p[at]), best[1], 0.0):
            best = (float(used[at + width // 2]), float(p[at]), float(sums[at]))
    return best


def _typical(power: FloatArray, summed: int, first: int) -> FloatArray:
    """(m,) mean power about each frequency from the `first`, by the larger of the medians below it and above it."""
    over = float(special.gammaincinv(summed, 0.5)) / summed  # the median of a gamma over its mean
    m, out = power.size, np.full(power.size, np.inf)
    medians = np.median(np.lib.stride_tricks.sliding_window_view(power, ABOUT), axis=1)  # of k to k + ABOUT - 1
    at = np.arange(first, m)
    below = np.array([np.median(power[:k]) for k in range(first, min(ABOUT, m))])
    below = np.concatenate([below, medians[max(first - ABOUT, 0) : m - ABOUT]])
    above = np.where(at + ABOUT < m, medians[np.minimum(at + 1, medians.size - 1)], 0.0)
    out[at] = np.maximum(np.maximum(below, above) / over, np.finfo(float).tiny)
    return out


def folded(left: FloatArray, at: FloatArray, period: float) -> tuple[float, FloatArray]:
    """The period near a found one that fits a residual best, and (n,) each row's place in it.

    A line is found among whole numbers of periods over the series: folded at such a one, phases would run away.

    Args:
        left: (n,) residual.
        at: (n,) time or number of each row.
        period: found, in the unit of `at`.

    """
    tried = 1.0 / period + np.linspace(-NEAR, NEAR, TRIED) / max(float(np.ptp(at)), period)
    wave = np.exp(2j * np.pi * np.outer(tried[tried > 0], at))
    twice = wave * wave
    power = sum(np.abs(one @ left) ** 2 for one in (wave, twice, twice * wave))
    best = float(1.0 / tried[tried > 0][ties.highest(power, float(np.max(power)))])
    return best, np.asarray(np.mod(at, best))


def over_phase(
    found: Line, left: FloatArray, at: FloatArray, period: float, unit: str, harmonics: int
) -> tuple[Block, Axis]:
    """Harmonics of a period that was found, and their axis: each row's place in it.

    Args:
        found: the period.
        left: (n,) residual.
        at: (n,) time or number of each row.
        period: of it, in `unit`.
        unit: of `at`.
        harmonics: largest number of them.

    """
    period, phase = folded(left, at, period)
    columns = turns(360.0 * phase / period, harmonics)
    block = Block(found.where, columns, (columns.shape[1],), rough_turns(columns))
    return block, Axis("phase", f"place in a period of {period:.4g} {unit}".rstrip(), unit, phase)
