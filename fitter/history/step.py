"""Did a parameter jump, at a date nobody told?"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from fitter.arrays import FloatArray
from fitter.history.components import Between, Profile
from fitter.history.series import Series

FEWEST = 4
_DRAWS = 9999
_SEED = 1


@dataclass(frozen=True)
class Step:
    """The step that explains most.

    Attributes:
        before: how many calibrations lie before it.
        size: value after less value before.
        stderr: its standard error, the date taken as known.
        p: probability of a step as clear as this at any date if there was none.
        explained: share of the sum of squares about the mean that it takes away.

    """

    before: int
    size: float
    stderr: float
    p: float
    explained: float


def step(series: Series) -> Step | None:
    """Look for one step between calibrations; None for fewer than four of them.

    The statistic is the largest of the m - 1 two-sample F. Its distribution, look-elsewhere included, is that of
    as many independent values of the same variances (simulated once, seeded): exact where all are alike.
    """
    if len(series) < FEWEST:
        return None
    psi = Profile.of(series, series.constant, Between.SCATTER).paule_mandel()
    weights = 1.0 / (series.variance + psi)
    weights = weights / weights.sum()
    gain, total = _gains(series.values[None, :], weights)
    at = int(np.argmax(gain[0]))
    share = float(gain[0, at] / total[0]) if total[0] > 0 else 0.0
    chance = _null(tuple(np.round(weights, 12).tolist()))
    head, tail = weights[: at + 1], weights[at + 1 :]
    after, before = (
        float(w @ v / w.sum()) for w, v in ((tail, series.values[at + 1 :]), (head, series.values[: at + 1]))
    )
    rest = (total[0] - gain[0, at]) / (len(series) - 2)
    return Step(
        before=at + 1,
        size=after - before,
        stderr=float(np.sqrt(rest * (1.0 / head.sum() + 1.0 / tail.sum()))),
        p=float((1 + np.sum(chance >= share)) / (len(chance) + 1)),
        explained=share,
    )


def _gains(values: FloatArray, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(n, m - 1) sum of squares that a step after each calibration takes away, and (n,) the total, of (n, m) values."""
    centred = values - (values @ weights)[:, None]
    below = np.cumsum(weights)[:-1]
    sums = np.cumsum(centred * weights, axis=1)[:, :-1]
    return sums**2 / (below * (1.0 - below)), np.sum(weights * centred**2, axis=1)


@lru_cache(maxsize=64)
def _null(weights: tuple[float, ...]) -> FloatArray:
    """(draws,) largest share that a step takes away where there is none."""
    w = np.array(weights)
    values = np.random.default_rng(_SEED).standard_normal((_DRAWS, len(w))) / np.sqrt(w)
    gain, total = _gains(values, w)
    return np.asarray(gain.max(axis=1) / total)
