"""Does a residual jump between two levels, staying some rows at each: popcorn noise, a loose contact, a sticking part?

A hidden chain of two states with normal errors about each (Hamilton, Econometrica 57 (1989) 357), its likelihood on a
grid of distances, shares and stays. It has to be held against noise that remembers, whose correlation is the same.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from fitter.arrays import FloatArray

FEWEST = 24
APART = (0.9, 1.15, 1.4, 1.6, 1.75, 1.85, 1.93, 1.98)
"""Distances of the levels that are tried, by the share of the variance: d^2 w (1 - w) over all of it, root, twice."""
SHARES = (0.15, 0.25, 0.35, 0.5, 0.65, 0.75, 0.85)
"""Of the rows at the upper level."""
STAYS = (3.0, 5.0, 8.0, 14.0, 25.0, 45.0)
"""Rows that a stay at the rarer level lasts on average."""
MIDDLES = (-0.3, 0.0, 0.3)
"""Of the series' mean in the run, by its standard deviation: a run is too short to have its shares exactly."""


@dataclass(frozen=True)
class TwoLevels:
    """Two levels, as likely as they can be made.

    Attributes:
        log_likelihood: of the series with unit sum of squares over n; compare with -n/2 log(rss/n).
        apart: distance of the levels, unit of the series.
        upper: share of rows at the upper.
        stay: rows that a stay at the rarer lasts on average.
        share: of the sum of squares that lies between the levels.

    """

    log_likelihood: float
    apart: float
    upper: float
    stay: float
    share: float


def two_levels(left: FloatArray) -> TwoLevels | None:
    """The likeliest two levels of a residual (n,) in the order of taking; None where there are too few rows.

    Its logarithm of the likelihood leaves out n/2 (1 + log 2 pi), as -n/2 log(rss/n) does for independent errors.
    """
    n = left.size
    sd = float(np.sqrt(np.mean(left**2)))
    if n < FEWEST or sd <= 0:
        return None
    grid = np.array(list(product(APART, SHARES, STAYS, MIDDLES)))
    between, upper, stay, middle = grid.T
    spread = 0.5 * between  # root of the share of the variance between the levels
    apart = spread / np.sqrt(upper * (1 - upper))
    rest = np.sqrt(1.0 - spread**2)
    low, high = middle - upper * apart, middle + (1 - upper) * apart
    rare = np.minimum(upper, 1 - upper)
    up = np.where(upper <= 0.5, rare / (1 - rare), 1.0) / stay  # chance to leave the lower level at a row
    down = np.where(upper <= 0.5, 1.0, rare / (1 - rare)) / stay
    total = np.zeros(len(grid))
    p = upper.copy()  # of being at the upper level
    u = left / sd
    for value in u.tolist():
        a = np.exp(-0.5 * ((value - high) / rest) ** 2)
        b = np.exp(-0.5 * ((value - low) / rest) ** 2)
        both = np.maximum(p * a + (1 - p) * b, 1e-300)
        total += np.log(both)
        p = p * a / both
        p = p * (1 - down) + (1 - p) * up
    total += 0.5 * n - n * np.log(rest) - n * np.log(sd)
    at = int(np.argmax(total))
    return TwoLevels(float(total[at]), float(apart[at] * sd), float(upper[at]), float(stay[at]), float(spread[at] ** 2))
