"""What remembers rows before: the last extreme of a variable, or what fades of all that came before.

A latch (a loose part, a bistable spring, magnetised iron) is in one state after the variable was above a limit, in the
other after it was below another one. Between the limits it stays as it was. Only there it differs from a function of
the variable. What creeps, soaks or warms up remembers all rows before, the later ones better.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rig.fitter.arrays import FloatArray, IntArray

LIMITS = ((0.25, 0.75), (0.25, 0.5), (0.5, 0.75))
"""Lower and upper limit of each latch, as parts of the variable's range."""


def latches(values: FloatArray, order: IntArray) -> FloatArray:
    """(n, 2 m) states of latches between their limits, alone and times the variable; of those that are seen in both.

    Args:
        values: (n,) the variable.
        order: (n,) rows in the order of running.

    """
    span = float(np.ptp(values))
    if span == 0.0:
        return np.empty((values.size, 0))
    u = (values - values.min()) / span
    every = np.column_stack([_state(u, order, low, high) for low, high in LIMITS])
    states = every[:, (every.min(axis=0) < 0.0) & (every.max(axis=0) > 0.0)]
    return np.column_stack([states, states * (2.0 * u - 1.0)[:, None]])


def _state(u: FloatArray, order: IntArray, low: float, high: float) -> FloatArray:
    """(n,) 1 after the upper limit was passed, -1 after the lower one; 0 outside them, and until one was passed."""
    told = np.where(u > high, 1.0, np.where(u < low, -1.0, 0.0))[order]
    last = np.maximum.accumulate(np.where(told != 0.0, np.arange(told.size), 0))
    state = np.empty(told.size)
    state[order] = np.where(told != 0.0, 0.0, told[last])
    return state


def faded(values: FloatArray, hours: FloatArray, order: Sequence[IntArray], memory: float) -> FloatArray:
    """(n, m) mean of the rows before, each with the weight that is left of it; of a first row the row itself.

    Args:
        values: (n, m) what is remembered.
        hours: (n,) when.
        order: rows of each stretch in the order of running: nothing is remembered from one to the next.
        memory: time in which what is remembered falls to 1/e, in the unit of `hours`.

    """
    out = np.array(values, np.float64)
    for rows in order:
        keep = np.exp(-np.diff(hours[rows]) / memory)
        for k in range(1, rows.size):
            before, last = out[rows[k - 1]], values[rows[k - 1]]
            out[rows[k]] = keep[k - 1] * before + (1.0 - keep[k - 1]) * last
    return out
