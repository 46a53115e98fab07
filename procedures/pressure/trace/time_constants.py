"""Time constants of effects of earlier settings, with their 95 % intervals, by the profile of the sum of squares."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from rig.fitter import ties
from rig.fitter.arrays import FloatArray
from rig.fitter.linear import orthonormal
from rig.fitter.quantiles import t_limit
from rig.procedures.pressure.trace.unmodelled import InTransducer

BEYOND, STEPS = 4.0, 81
"""The profile goes so far beyond the values of the catalogue, in so many equal steps of the logarithm."""
HOUR_S = 3600.0


def time_constant(transducers: Iterable[InTransducer], name: str) -> list[dict[str, Any]]:
    """The time constant of an effect as JSON values: name, estimate, standard error, unit, and 95 % interval.

    Readings are compared within whole plots, of all transducers that the effect concerns. The interval has the values
    beside which the sum of squares is higher by less than the square of Student's limit.

    Args:
        transducers: with their findings, as far as they have the effect.
        name: of the effect.

    Returns:
        One; none without a time constant, or where terms of the effect have several.
    """
    having = [one for one in transducers if one.of(name)]
    terms = [one.run.candidates[int(one.numbers[j])].term for one in having for j in one.of(name)]
    known = {one.constant[0] for one in terms if one.constant is not None}
    if len(known) != 1 or any(one.constant is None for one in terms):
        return []
    (found,) = known
    taus = np.geomspace(found / 6.0 / BEYOND, found * 6.0 * BEYOND, STEPS)
    rise, df = np.zeros(STEPS), np.inf
    for one in having:
        beside = one.beside(tuple(j for j in one.chosen if j not in one.of(name)), "subplot")
        left = np.array([_left(beside.y, beside.project(_columns(one, name, tau))) for tau in taus.tolist()])
        free = float(one.view("subplot").df[0]) - 1.0
        if free < 1.0 or left.min() <= 0.0:
            return []
        rise += left / (left.min() / free)
        df = min(df, free)
    best, t = ties.lowest(rise), t_limit(0.95, df)
    inside = np.flatnonzero(rise - rise[best] <= t**2)
    low, high = (float(taus[k]) * HOUR_S for k in (inside.min(), inside.max()))
    closed = inside.min() > 0 and inside.max() < STEPS - 1
    told: dict[str, Any] = {"name": "time constant", "estimate": float(taus[best]) * HOUR_S, "unit": "s"}
    spread = told["estimate"] * float(np.log(high / low)) / (2.0 * t)
    return [told | {"stderr": spread if closed else None, "interval_95": [low, high] if closed else None}]


def _columns(one: InTransducer, name: str, tau: float) -> FloatArray:
    """(n, q) columns of an effect with another time constant."""
    terms = (one.run.candidates[int(one.numbers[j])].term for j in one.of(name))
    return np.column_stack([term.constant[1](tau)(one.scene) for term in terms if term.constant is not None])


def _left(y: FloatArray, columns: FloatArray) -> float:
    """Sum of squares of a residual beside columns."""
    return float(y @ y - np.sum((orthonormal(columns).T @ y) ** 2))
