"""Settings that change in one direction only: an effect of theirs is also one of time, of whatever shape."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np

from rig.fitter.arrays import FloatArray

_LEVELS, _BETWEEN = 3, 0.99
"""Fewest levels, and smallest share of the variance of time between them: little time passes within one."""


def swept(values: FloatArray, time: FloatArray) -> bool:
    """Whether a variable only rises, or only falls, with time.

    Args:
        values: (n,) of the variable, in the order of time.
        time: (n,) ascending.
    """
    steps = np.diff(values)
    level = np.unique(values, return_inverse=True)[1]
    if level.max(initial=0) + 1 < _LEVELS or not (np.all(steps >= 0) or np.all(steps <= 0)):
        return False
    count = np.bincount(level)
    means = np.bincount(level, time) / count
    return bool(count @ (means - time.mean()) ** 2 >= _BETWEEN * np.sum((time - time.mean()) ** 2))


def all_swept(variables: Mapping[str, FloatArray], time: FloatArray) -> tuple[str, ...]:
    """Names of the variables that only rise, or only fall, with time."""
    return tuple(name for name, values in variables.items() if swept(values, time))


def functions_alike(
    columns: Collection[str], others: Collection[Collection[str]], one_course: Collection[str]
) -> list[str]:
    """Names of what else an effect may be, if time and the variables that it is over run through one course.

    Args:
        columns: that it is over.
        others: columns that each cause is over which the data cannot distinguish from it.
        one_course: time, and what was swept with it.
    """
    if not columns or not set(columns) <= set(one_course):
        return []
    said = [set(columns), *map(set, others)]
    return [f"function:{name}" for name in one_course if {name} not in said]


def swept_once(name: str, time: str) -> str:
    """Sentence about a swept variable."""
    return (
        f"{name} changes in one direction only, with {time}: what drifts in time is in the coefficients of {name}, "
        f"too, and these data cannot tell; measured up and down, or in random order, they can"
    )
