"""Least value of a function of one number between two ends.

As `scipy.optimize.minimize_scalar` with bounds, whose package takes 0.2 s to import.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

_SHARE = (5.0**0.5 - 1.0) / 2.0
_FINEST = 2e-8
"""Relative distance within which a function of doubles has no clear least value."""


class Least(NamedTuple):
    """Where a function is least, and its value there."""

    x: float
    value: float


def least(function: Callable[[float], float], low: float, high: float, within: float = 1e-5) -> Least:
    """The least value between two ends by golden section (Kiefer, Proc. AMS 4 (1953) 502); of several, a local one.

    Args:
        function: of the number.
        low: lower end.
        high: upper end.
        within: distance from the place, in units of the number.

    Example:
        >>> round(least(lambda x: (x - 2.0) ** 2, 0.0, 10.0).x, 4)
        2.0
    """
    within = max(within, _FINEST * max(abs(low), abs(high)))
    left, right = high - _SHARE * (high - low), low + _SHARE * (high - low)
    at_left, at_right = function(left), function(right)
    while high - low > within:
        if at_left < at_right:
            high, right, at_right = right, left, at_left
            left = high - _SHARE * (high - low)
            at_left = function(left)
        else:
            low, left, at_left = left, right, at_right
            right = low + _SHARE * (high - low)
            at_right = function(right)
    return min(Least(left, at_left), Least(right, at_right), key=lambda one: one.value)
