"""Test of a step of a parameter at an unknown date."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from rig.fitter import ties
from rig.fitter.arrays import FloatArray
from rig.fitter.history.between_calibrations import Between, Profile
from rig.fitter.history.series import Series

FEWEST = 4
_DRAWS = 9999
_SEED = 1


@dataclass(frozen=True)
class Step:
    """The step that explains most.

    Attributes:
        before: number of calibrations before it.
        size: value after minus value before.
        stderr: its standard error, for a known date.
        p: probability of such a clear step at any date without a step.
        explained: its share of the sum of squares about the mean.
    """

    before: int
    size: float
    stderr: float
    p: float
    explained: float


def step(series: Series) -> Step | None:
    """Look for one step between calibrations; None for fewer than four of them.

    The statistic is the largest of the m - 1 two-sample F. Its distribution, with the choice of the date, is that of
    the same number of independent values with the same variances (simulated once, seeded): exact for equal variances.
    """
    if len(series) < FEWEST:
        return None
    psi = Profile.of(series, series.constant, Between.SCATTER).paule_mandel()
    weights = 1.0 / (series.variance + psi)
    weights = weights / weights.sum()
    gain, total = _gains(series.values[None, :], weights)
    at = ties.highest(gain[0], 0.0)
    share = float(gain[0, at]) / float(total[0]) if total[0] > 0 else 0.0
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
    """(n, m - 1) sum of squares explained by a step after each calibration, and (n,) the total, for (n, m) values."""
    centred = values - (values @ weights)[:, None]
    below = np.cumsum(weights)[:-1]
    sums = np.cumsum(centred * weights, axis=1)[:, :-1]
    return sums**2 / (below * (1.0 - below)), np.sum(weights * centred**2, axis=1)


@lru_cache(maxsize=64)
def _null(weights: tuple[float, ...]) -> FloatArray:
    """(draws,) largest share explained by a step without a step."""
    w = np.array(weights)
    values = np.random.default_rng(_SEED).standard_normal((_DRAWS, len(w))) / np.sqrt(w)
    gain, total = _gains(values, w)
    return np.asarray(gain.max(axis=1) / total)
