"""A quantity that is set from time to time: time and direction of its last change, and its decaying lag."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable
from math import exp, expm1

_OVER = 40.0
"""Number of time constants after which a step has decayed below double precision."""


class Steps:
    """Values and the times from which they hold.

    Args:
        start: virtual time of the first value, which also holds for all earlier times.
        value: the first value.
    """

    def __init__(self, start: float, value: float) -> None:
        self._times = [start]
        self._values = [value]
        self._takes = [0.0]
        self._settled: dict[float, dict[int, float]] = {}

    def set(self, now: float, value: float, takes_s: float = 0.0) -> None:
        """Change to this value from `now` on, with a ramp of this many seconds; `now` never decreases between calls."""
        self._times.append(now)
        self._values.append(value)
        self._takes.append(takes_s)

    def cut(self, now: float, value: float) -> None:
        """End the ramp that is in force at `now`, at this value; nothing happens if none is."""
        if now < self._times[-1] + self._takes[-1]:
            self._values[-1], self._takes[-1] = value, now - self._times[-1]
            self._settled.clear()

    def since(self, t: float) -> float:
        """Time at which the value in force at `t` was set."""
        return self._times[self._at(t)]

    def changed(self, t: float, least: float) -> float:
        """Time of the last change by more than `least` before `t`; that of the first value if there was none."""
        values = self._values
        for i in range(self._at(t), 0, -1):
            if abs(values[i] - values[i - 1]) > least:
                return self._times[i]
        return self._times[0]

    def value(self, t: float) -> float:
        """The value in force at `t`."""
        return self._values[self._at(t)]

    def direction(self, t: float) -> int:
        """Direction of the last change before `t`: 1 up, -1 down, 0 if there was none."""
        values = self._values
        for i in range(self._at(t), 0, -1):
            if values[i] != values[i - 1]:
                return 1 if values[i] > values[i - 1] else -1
        return 0

    def behind(self, t: float, time_constant_s: float, of: Callable[[float], float] | None = None) -> float:
        """Difference between a first-order lag and the followed value at `t`; the lag was at rest before the first
        change. Of a function of the value, if one is given.
        """
        above, values = 0.0, self._values if of is None else [of(value) for value in self._values]
        # what a step leaves behind at the end of its ramp
        settled = self._settled.setdefault(time_constant_s, {}) if of is None else {}
        times, takes = self._times, self._takes
        for i in range(self._at(t), 0, -1):
            gone, ramp = (t - times[i]) / time_constant_s, takes[i] / time_constant_s
            since = gone - ramp
            if since > _OVER:
                break
            if since < 0.0:
                above += (values[i - 1] - values[i]) * (-expm1(-gone) / ramp)
                continue
            left = settled.get(i)
            if left is None:
                built_up = -expm1(-ramp) / ramp if ramp > 0.0 else 1.0
                left = settled[i] = (values[i - 1] - values[i]) * built_up
            above += left * exp(-since)
        return above

    def _at(self, t: float) -> int:
        at = bisect_right(self._times, t) - 1
        return at if at > 0 else 0
