"""Choices among values that may be equal but for rounding: the first of equals counts, whatever processor rounds.

Columns of a design are often the same ones under two names, and sums over symmetric points are equal. Which of two such
values is larger in the last digits depends on the processor's kernels (`tools/kernels` runs the tests under several).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rig.fitter.arrays import FloatArray, IntArray

TIE = 1e-6
"""Difference, in units of what is compared, below which values are equal.

In runs whose columns depend on each other nearly, evidence of one cause under two names differed by up to 5e-8.
"""
SHARE = 1e-9
"""The same as a share of the value."""


def highest(values: Sequence[float] | FloatArray, unit: float = 1.0) -> int:
    """Index of the highest of the values (m,), the first of equals.

    Args:
        values: finite, or minus infinity where one is impossible.
        unit: of a difference that says something; 1 for logarithms of likelihoods and what is priced like them.

    Example:
        >>> highest(np.array([1.0, 3.0, 3.0 + 1e-12]))
        1

    """
    every = np.asarray(values)
    return int(np.argmax(every >= _below(float(every.max()), unit)))


def lowest(values: Sequence[float] | FloatArray, unit: float = 1.0) -> int:
    """Index of the lowest of the values (m,), the first of equals; see `highest`.

    Example:
        >>> lowest(np.array([2.0, 1.0 + 1e-12, 1.0]))
        1

    """
    return highest(-np.asarray(values), unit)


def descending(values: Sequence[float] | FloatArray, unit: float = 1.0) -> IntArray:
    """(m,) indices from the highest to the lowest value, equals in their order; see `highest`.

    Example:
        >>> descending(np.array([1.0, 3.0, 3.0 + 1e-12, 5.0])).tolist()
        [3, 1, 2, 0]

    """
    every = np.asarray(values)
    order = np.argsort(-every, kind="stable")
    ahead = every[order]
    with np.errstate(invalid="ignore"):  # of two that are impossible
        steps = ahead[1:] < ahead[:-1] - TIE * unit - SHARE * np.abs(ahead[:-1])
    place = np.concatenate([[0], np.cumsum(steps)])[: order.size]
    return np.asarray(order[np.lexsort((order, place))], np.int64)


def below(value: float, other: float, unit: float = 1.0) -> bool:
    """Whether a value is lower than another by more than rounding; see `highest`."""
    return value < _below(other, unit)


def _below(value: float, unit: float) -> float:
    return value - TIE * unit - SHARE * abs(value) if np.isfinite(value) else value
