"""Whether a step is sudden: a change that goes on for a good part of the run is another cause.

A step is the refuge of whatever begins at some time. It is only named for sure if every such change is a worse
explanation: a ramp over two or three fifths of the run, a slope that begins at some time and lasts to the end, or one
that lasts from the beginning until some time.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rig.fitter.arrays import FloatArray

BEGINS = np.arange(0.0, 0.65, 0.05)
"""Tried moments, as parts of the time of the run."""
LASTS = (0.4, 0.6)
"""Tried durations of a ramp between two levels, likewise."""


def slopes(time: FloatArray) -> FloatArray:
    """(n, m) changes that last, over a time (n,) that is not constant."""
    u = (time - time.min()) / float(np.ptp(time))
    every = [np.maximum(u - begin, 0.0) for begin in BEGINS]
    every += [np.minimum(u, 1.0 - begin) for begin in BEGINS]
    every += [np.clip(u - begin, 0.0, last) for last in LASTS for begin in BEGINS if begin + last <= 1.0]
    return np.column_stack(every)


def lead_over_slopes(
    y: FloatArray, gain: float, variance: float, columns: FloatArray, project: Callable[[FloatArray], FloatArray]
) -> float:
    """By how much a step explains more than every change that lasts, in units of the error's variance.

    Args:
        y: (n,) residual without the step.
        gain: sum of squares that the step explains of it.
        variance: of the error beside the step.
        columns: (n, m) changes that last.
        project: removes the rest of the model from columns.

    """
    left = project(columns)
    length2 = np.sum(left**2, axis=0)
    able = length2 > np.finfo(float).tiny
    if not np.any(able):
        return np.inf
    best = float(np.max((y @ left[:, able]) ** 2 / length2[able]))
    return (gain - best) / max(variance, np.finfo(float).tiny)
