"""Jumps of a residual between two levels, with several rows at each: popcorn noise, a loose contact, a sticking part.

A hidden chain of two states with normal errors about each (Hamilton, Econometrica 57 (1989) 357), its likelihood on a
grid of distances, shares and stays. It must be compared with noise with memory, which has the same correlation.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from rig.fitter import ties
from rig.fitter.arrays import FloatArray

FEWEST = 24
APART = (0.9, 1.15, 1.4, 1.6, 1.75, 1.85, 1.93, 1.98)
"""Tried distances of the levels: twice the square root of the share d^2 w (1 - w) of the variance between them."""
SHARES = (0.15, 0.25, 0.35, 0.5, 0.65, 0.75, 0.85)
"""Share of the rows at the upper level."""
STAYS = (3.0, 5.0, 8.0, 14.0, 25.0, 45.0)
"""Mean number of rows of a stay at the rarer level."""
MIDDLES = (-0.3, 0.0, 0.3)
"""Offsets of the mean in a run, in standard deviations: in a short run the shares differ from their expectation."""
LONG = 2000
"""Rows from which on the mean is where it is expected: there are forty stays at least."""
ROUNDS = 5
"""Maximum number of alternating fits of levels and model."""
NEAR = 12.0
"""Nats: grid values farther behind the best are not tried again."""

TOGETHER = 500
"""Rows whose densities are computed at once, for each line of the grid."""
MOST = 600.0
"""Maximum logarithm of the odds by one row, below the range of a double."""


@dataclass(frozen=True)
class TwoLevels:
    """The most probable two levels.

    Attributes:
        log_likelihood: of the series with unit sum of squares over n; compare with -n/2 log(rss/n).
        apart: distance of the levels, unit of the series.
        upper: share of rows at the upper level.
        stay: mean number of rows of a stay at the rarer level.
        share: share of the sum of squares between the levels.

    """

    log_likelihood: float
    apart: float
    upper: float
    stay: float
    share: float


def two_levels(left: FloatArray, basis: FloatArray) -> TwoLevels | None:
    """The most probable two levels of a residual (n,) in the order of measurement; None where there are too few rows.

    The model may have absorbed a part of the levels, so model and levels are fitted alternately.

    Args:
        left: (n,) residual.
        basis: (n, q) orthonormal, of the model.

    Returns:
        Its log-likelihood is without the constant n/2 (1 + log 2 pi), like -n/2 log(rss/n) for independent errors.

    """
    if left.size < FEWEST or not np.any(left):
        return None
    middles = MIDDLES if left.size < LONG else (0.0,)
    grid, series, best = np.array(list(product(APART, SHARES, STAYS, middles))), left, None
    for _ in range(ROUNDS):
        total = _likelihoods(series, grid)
        at = ties.highest(total)
        found = _found(series, grid[at], float(total[at]))
        if best is not None and found.log_likelihood <= best.log_likelihood:
            break
        best, upper, grid = found, _posterior(series, grid[at]), grid[total > total[at] - NEAR]
        taken = basis @ (basis.T @ upper)
        own = upper - taken
        if float(own @ own) <= 0:
            break
        series = left + float(own @ left) / float(own @ own) * (taken - taken.mean())
    return best


def _parts(grid: FloatArray) -> tuple[FloatArray, ...]:
    """Levels, scatter about them, and probabilities per row of a jump up and down, for each line of a grid (m, 4)."""
    between, upper, stay, middle = grid.T
    spread = 0.5 * between  # root of the share of the variance between the levels
    apart, rest = spread / np.sqrt(upper * (1 - upper)), np.sqrt(1.0 - spread**2)
    low, high = middle - upper * apart, middle + (1 - upper) * apart
    odds = np.minimum(upper, 1 - upper) / np.maximum(upper, 1 - upper)
    up, down = np.where(upper <= 0.5, odds, 1.0) / stay, np.where(upper <= 0.5, 1.0, odds) / stay
    return low, high, rest, up, down


def _likelihoods(series: FloatArray, grid: FloatArray) -> FloatArray:
    """(m,) log-likelihoods of a series (n,) for each line of the grid, by the filter of the chain."""
    sd = float(np.sqrt(np.mean(series**2)))
    low, high, rest, up, down = _parts(grid)
    stays, total = 1 - down - up, np.zeros(len(grid))
    p = grid[:, 1].copy()  # of being at the upper level
    for start in range(0, series.size, TOGETHER):
        some = series[start : start + TOGETHER, None] / sd
        at_upper, at_lower = (-0.5 * ((some - level) / rest) ** 2 for level in (high, low))
        most = np.maximum(at_upper, at_lower)
        a, b = np.exp(at_upper - most), np.exp(at_lower - most)
        both = a - b
        # In place, since this loop over rows takes most of the time; the logarithms come after it.
        for of_row, upper, lower in zip(both, a, b, strict=True):
            np.multiply(of_row, p, out=of_row)
            np.add(of_row, lower, out=of_row)
            p *= upper
            p /= of_row
            p *= stays
            p += up
        total += np.sum(most + np.log(both), axis=0)
    return np.asarray(total + series.size * (0.5 - np.log(rest) - np.log(sd)))


def _found(series: FloatArray, line: FloatArray, log_likelihood: float) -> TwoLevels:
    sd, (between, upper, stay, _) = float(np.sqrt(np.mean(series**2))), line.tolist()
    apart = 0.5 * between / np.sqrt(upper * (1 - upper)) * sd
    return TwoLevels(log_likelihood, float(apart), upper, stay, 0.25 * between**2)


def _posterior(series: FloatArray, line: FloatArray) -> FloatArray:
    """(n,) probability of the upper level at each row, given all rows."""
    sd = float(np.sqrt(np.mean(series**2)))
    low, high, rest, up, down = (float(part[0]) for part in _parts(line[None]))
    at_lower, at_upper = (-0.5 * ((series / sd - level) / rest) ** 2 for level in (low, high))
    odds = np.exp(np.clip(at_upper - at_lower, -MOST, MOST)).tolist()
    # Probabilities of the upper level by the rows up to each, and odds of it by the rows after it.
    upper, before = float(line[1]), []
    for at in odds:
        before.append(upper := upper * at / (upper * at + 1 - upper))
        upper = upper * (1 - down) + (1 - upper) * up
    later, after = 1.0, []
    for at in reversed(odds):
        after.append(later)
        later = ((1 - down) * at * later + down) / (up * at * later + 1 - up)
    weighed = np.array(before) * np.array(after[::-1])
    return np.asarray(weighed / (weighed + 1 - np.array(before)))
