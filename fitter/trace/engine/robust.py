"""Isolated outliers: reduced during the search for effects, so that a few neither create nor mask one."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import special

from rig.fitter import ties
from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.effects.noise_names import OUTLIERS
from rig.fitter.resolution import least_robust_sd, robust_sd
from rig.fitter.trace.chance import ALPHA, counted
from rig.fitter.trace.limits import limit

ALONE = 4.5
"""Robust standard deviations from which a reading counts as isolated."""
FEW = 8.0
"""Number of rows at which the limit is doubled: few rows do not determine their scale well."""
HELD = 3.0
"""Standard deviations to which it is reduced."""
NEIGHBOURS = 3
"""Number of neighbours on either side for the running median from which a reading of an ordered table must also
deviate.
"""
INSIDE, MOST = limit("inner residuals", "whole-plot"), limit("most outliers", "whole-plot")
"""Share of residuals for the scale of rows in groups, and of isolated ones beyond which there are none: they are noise
with long tails, or an effect.
"""
FEWEST = 15
AGAIN, SAME = 6, 0.02
"""Fits of a model to rows that are reduced beside the last fit, and the relative change that is none."""


def isolated(
    y: FloatArray,
    basis: FloatArray,
    ordered: bool,
    step: FloatArray | float,
    near: Callable[[], IntArray | None],
    group: IntArray | None,
    sd: FloatArray,
) -> FloatArray:
    """(n,) reduction of isolated outliers of a response (n,) beside the orthonormal columns (n, k) of a model.

    Least squares turn towards a gross error, and what it pulls aside looks isolated, or hides it: the model is fitted
    again to the reduced response. Arguments as for `excess`; where rows of a `group` (n,) have an error in common, a
    row is isolated beside the median of its group; `sd` (n,) is what each row was divided by.
    """
    off = np.zeros_like(y)
    for _ in range(AGAIN):
        before, left = off, y - basis @ (basis.T @ (y - off))
        off = excess(left, ordered=ordered, step=step, near=near) if group is None else in_groups(left, step, group, sd)
        if np.allclose(off, before, rtol=SAME, atol=0.0):
            break
    return off


def in_groups(
    left: FloatArray,
    step: FloatArray | float,
    group: IntArray,
    sd: FloatArray,
    most: float = MOST,
    sensors: int | None = None,
) -> FloatArray:
    """(n,) reduction of isolated residuals beside the others of their group; of more than a share of `most`, none.

    On the scale of a quantile of all: an effect that the model lacks is larger in some rows of each group. For so many
    `sensors` of a long run only where the clearest is beyond chance: the whole search is repeated for them.
    """
    left = left - _medians(left * sd, group)[group] / sd
    usual = robust_sd(left, step, INSIDE)
    held = np.clip(left, -HELD * usual, HELD * usual)
    off = np.where(np.abs(left) > _limit(len(left)) * usual, left - held, 0.0)
    chance = 0.0 if sensors is None or not np.any(off) else _by_chance(float(np.max(np.abs(left))) / usual, len(left))
    few = np.count_nonzero(off) <= max(most * len(left), 1.0)
    return off if few and counted(chance, sensors or 1) <= ALPHA else np.zeros_like(left)


def _by_chance(sd: float, n: int, df: float = np.inf) -> float:
    """Probability that one of n rows is so many standard deviations off, at most."""
    return min(2.0 * float(special.stdtr(df, -sd)) * n, 1.0)


def _medians(values: FloatArray, group: IntArray) -> FloatArray:
    """Median of each group."""
    ordered, count = values[np.lexsort((values, group))], np.bincount(group)
    first = np.cumsum(count) - count
    return np.asarray(0.5 * (ordered[first + (count - 1) // 2] + ordered[first + count // 2]))


def told(
    off: FloatArray, deviation: FloatArray, error: FloatArray, df: float, sensors: int, place: Callable[[int], str]
) -> dict[str, Any] | None:
    """Attributes of the finding about rows of a sensor that are reduced; None where there are none beyond chance.

    Args:
        off: (n,) reduction of each row, zero for most.
        deviation: (n,) of each row from the model, before it is reduced.
        error: (n,) standard deviation of each row.
        df: degrees of freedom of that.
        sensors: of the run, each of which is asked.
        place: words for a row.

    """
    rows = np.flatnonzero(off)
    rows = rows[ties.descending(np.abs(deviation[rows] / error[rows]))]
    sd = np.abs(deviation[rows] / error[rows])
    p = min(_by_chance(float(sd[0]), off.size, df) * sensors, 1.0) if rows.size else 1.0
    if p > ALPHA:
        return None
    return {
        "effect": OUTLIERS,
        "cause": "readings that no scatter of the others explains; each counts as three standard deviations in the "
        "search and in the fits here",
        "terms": tuple(place(row) for row in rows.tolist()),
        "coefficients": tuple(deviation[rows].tolist()),
        "size": f"{rows.size} of {off.size} readings, up to {sd[0]:.3g} sd",
        "p": p,
        "separate_by": "look in the log at these readings, and repeat them",
        "against": "elapsed_s",
    }


def excess(
    left: FloatArray,
    *,
    ordered: bool,
    step: FloatArray | float = 0.0,
    near: Callable[[], IntArray | None] = lambda: None,
) -> FloatArray:
    """(n,) reduction of isolated residuals (n,), over each row's sd; zero for all others.

    A reading is isolated only if it deviates from the model and, if the order of measurement is known, from its
    neighbours too: a level common to several readings is an effect. So is one that deviates together with the rows
    (n, k) `near` it, which have about the same settings: they are a shape, such as a peak. Where none deviates, `near`
    is not asked. `step` is the rounding step of the values, one or (n,), in the unit of the residual.
    """
    if len(left) < FEWEST or np.max(np.abs(left)) <= _limit(len(left)) * _at_least(left, least_robust_sd(left, step)):
        return np.zeros_like(left)  # most calls: a lower limit of the scale takes a small part of its time
    off, limit = _beyond(left, step)
    if not np.any(off):
        return off
    if ordered and len(left) > 4 * NEIGHBOURS:
        local, _ = _beyond(left - running_median(left), step)
        off = np.where(_by_neighbours(np.abs(local), np.abs(off)), local, off)
    around = near()
    if around is not None:
        rows = np.flatnonzero(off)
        off[rows[np.abs(left[rows] - np.median(left[around[rows]], axis=1)) <= limit]] = 0.0
    return off


def _by_neighbours(local: FloatArray, off: FloatArray) -> NDArray[np.bool_]:
    """(n,) whether the reduction of a row beside its neighbours holds, by its size and by that beside the model.

    The larger of two, where the row is isolated by both: a missing effect widens the scale of the residuals, and a
    gross error that is reduced to that alone would hide it. At the ends the smaller one: a bend there has neighbours on
    one side only.
    """
    smaller = local < off
    inside = slice(NEIGHBOURS, len(off) - NEIGHBOURS)
    smaller[inside] = (local[inside] == 0.0) | ((off[inside] > 0.0) & (local[inside] > off[inside]))
    return smaller


def scale(left: FloatArray, step: FloatArray | float = 0.0) -> float:
    """Standard deviation by the median of absolute values, at least a fifth of the rms and that of rounding."""
    return _at_least(left, robust_sd(left, step))


def _at_least(left: FloatArray, sd: float) -> float:
    """At least a fifth of the rms of the residuals (n,), as they are reduced: a gross error does not widen its own."""
    least, before = 0.2 * float(np.sqrt(np.mean(left**2))), np.inf
    while sd < least < 0.99 * before:
        before = least
        reduced = np.clip(left, -HELD * least, HELD * least)
        least = 0.2 * float(np.sqrt(np.mean(reduced**2)))
    return max(sd, least)


def _limit(n: int) -> float:
    """Standard deviations from which one of n readings is isolated."""
    return ALONE * (1.0 + FEW / n)


def running_median(values: FloatArray) -> FloatArray:
    """(n,) median of each value and its neighbours."""
    padded = np.pad(values, NEIGHBOURS, mode="reflect")
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * NEIGHBOURS + 1)
    return np.asarray(np.partition(windows, NEIGHBOURS, axis=1)[:, NEIGHBOURS])


def _beyond(deviation: FloatArray, step: FloatArray | float) -> tuple[FloatArray, float]:
    """Part of each deviation beyond `HELD`, for those beyond `ALONE`; and the size from which on these are isolated."""
    sd = scale(deviation, step)
    held, limit = np.clip(deviation, -HELD * sd, HELD * sd), _limit(len(deviation)) * sd
    return np.where(np.abs(deviation) > limit, deviation - held, 0.0), limit
