"""Choices among values that may be equal but for rounding: the first of equals counts, whatever processor rounds.

Columns of a design are often the same ones under two names, and sums over symmetric points are equal. Which of two such
values is larger in the last digits depends on the processor's kernels (`tools/kernels` runs the tests under several).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import TypeVar

import numpy as np

from rig.fitter.arrays import FloatArray, IntArray

T = TypeVar("T")

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


def highest_of_each(values: FloatArray, unit: float = 1.0) -> IntArray:
    """(k,) rows of the highest of each column of values (m, k), the first of equals; see `highest`.

    Example:
        >>> highest_of_each(np.array([[3.0, 1.0], [3.0 + 1e-12, 2.0]])).tolist()
        [0, 1]

    """
    return np.asarray(np.argmax(values >= _each_below(values.max(axis=0), unit), axis=0), np.int64)


def descending(values: Sequence[float] | FloatArray, unit: float = 1.0) -> IntArray:
    """(m,) indices from the highest to the lowest value, equals in their order; no number is last. See `highest`.

    Example:
        >>> descending(np.array([1.0, 3.0, 3.0 + 1e-12, 5.0])).tolist()
        [3, 1, 2, 0]

    """
    every = np.nan_to_num(np.asarray(values, np.float64), nan=-np.inf, posinf=np.inf, neginf=-np.inf)
    order = np.argsort(-every, kind="stable")
    ahead = every[order]
    place = np.concatenate([[0], np.cumsum(ahead[1:] < _each_below(ahead[:-1], unit))])[: order.size]
    return np.asarray(order[np.lexsort((order, place))], np.int64)


def top(values: FloatArray, count: int) -> IntArray:
    """(count,) indices of the highest values, or all where there are fewer, highest first; see `descending`.

    Values are compared as shares alone. Of many it is faster than an order of all.

    Example:
        >>> top(np.array([1.0, 3.0, 3.0 + 1e-12, 5.0]), 2).tolist()
        [3, 1]

    """
    last = np.partition(values, -count)[-count] if count < values.size else -np.inf
    near = np.flatnonzero(values >= _below(float(last), 0.0))
    return near[descending(values[near], 0.0)][:count]


def ordered(items: Iterable[T], key: Callable[[T], float], unit: float = 0.0) -> list[T]:
    """Items from the lowest to the highest key, equals in their order.

    They are compared as shares alone but for a `unit`; see `highest`.

    Example:
        >>> ordered(["c", "a", "b"], key={"a": 1.0, "b": 1.0 - 1e-12, "c": 2.0}.__getitem__)
        ['a', 'b', 'c']

    """
    every = list(items)
    return [every[k] for k in descending([-key(one) for one in every], unit)]


def least(items: Iterable[T], key: Callable[[T], float], unit: float = 0.0) -> T:
    """The item of the lowest key, the first of equals; see `ordered`. Raises `ValueError`: there are none.

    Example:
        >>> least(["a", "b"], key={"a": 1.0, "b": 1.0 - 1e-12}.__getitem__)
        'a'

    """
    every = list(items)
    return every[lowest([key(one) for one in every], unit)]


def below(value: float, other: float, unit: float = 1.0) -> bool:
    """Whether a value is lower than another by more than rounding; see `highest`."""
    return value < _below(other, unit)


def _below(value: float, unit: float) -> float:
    return value - TIE * unit - SHARE * abs(value) if math.isfinite(value) else value


def _each_below(values: FloatArray, unit: float) -> FloatArray:
    with np.errstate(invalid="ignore"):  # of those that are impossible
        return np.where(np.isfinite(values), values - TIE * unit - SHARE * np.abs(values), values)
