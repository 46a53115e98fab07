"""Replications added until an interval is narrow enough, and the factor by which it is wider so that it then holds.

Who adds data until a standard error is small stops more often where the error was estimated too small: an interval of
Student's t then holds less often than stated. In a linear model with normal errors the estimates are independent of
the residual mean squares so far, and so of a rule that looks at these alone. Hence the coverage of an interval of c
standard errors at the end is the mean of 2 Phi(c s / sigma) - 1, where s is the estimate of sigma at the end. It
depends on the goal relative to sigma alone. Here c is t, of the degrees of freedom at the end, times the smallest
factor with which the least coverage over all goals is the stated one.

N. Starr, The performance of a sequential procedure for the fixed-width interval estimation of the mean, Ann. Math.
Statist. 37 (1966) 36-50, has the coverage of t alone, and that independence.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from scipy.special import ndtr, stdtrit

from rig.fitter.arrays import FloatArray

LEVEL = 0.95
_DRAWS, _SEED = 20_000, 20261129
_GOALS = 60
"""Number of goals at which coverage is computed."""
_WIDEST, _TOLERANCE = 3.0, 1e-4


def t_of(df: float, level: float = LEVEL) -> float:
    """Quantile of Student's t of a two-sided interval."""
    return float(stdtrit(df, 0.5 + level / 2.0))


@lru_cache(maxsize=64)
def widening(df: float, more: float, looks: int, first: float, level: float = LEVEL) -> float:
    """Factor of Student's t of an interval that holds in spite of looking after every replication, or after every part
    of one that is added; at least 1.

    Args:
        df: degrees of freedom at the first look.
        more: degrees of freedom that every further replication, or part, adds.
        looks: maximum number of looks.
        first: number of replications, or parts, at the first look.
        level: stated coverage.
    """
    if looks < 2:
        return 1.0
    ended = _ended(df, more, looks, first, level)
    low, high = 1.0, _WIDEST
    while high - low > _TOLERANCE:
        middle = 0.5 * (low + high)
        least = min(float(np.mean(2.0 * ndtr(middle * half_widths) - 1.0)) for half_widths in ended)
        low, high = (middle, high) if least < level else (low, middle)
    return high


def _ended(df: float, more: float, looks: int, first: float, level: float) -> list[FloatArray]:
    """Half-widths by t at the end, over the true standard error: a list over goals, from easy to unreachable ones.

    A run stops at the first look at which the half-width is at most the goal, or at the last one.
    """
    rng = np.random.default_rng(_SEED)
    steps = np.concatenate([[df], np.full(looks - 1, more)])
    degrees: Any = np.cumsum(steps)
    squares = np.cumsum(rng.chisquare(steps, size=(_DRAWS, looks)), axis=1) / degrees
    relative = stdtrit(degrees, 0.5 + level / 2.0) * np.sqrt(squares)
    n = first + np.arange(looks)
    found = []
    for goal in np.geomspace(0.5 / np.sqrt(n[-1]), 2.0 / np.sqrt(n[0]), _GOALS) * relative.mean():
        stops = relative / np.sqrt(n) <= goal
        stops[:, -1] = True
        found.append(relative[np.arange(_DRAWS), np.argmax(stops, axis=1)])
    return found
