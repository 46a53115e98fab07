"""The statistical tests of early warnings, each for one output: noise, drift at repeated settings, drift from a
calibration.

One more test finds thermometers that hang.

Every test is made after every observation, on windows of the last few. The probability of any false alarm in a whole
run is below `ALARM` for all tests together. The thresholds use Bonferroni's inequality over points, outputs and
windows, which holds for overlapping windows too. Assumptions: readings within a point are independent and normal, and
so are the errors of settings. These tests report every slow change as drift, even one that a laboratory considers
normal.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Hashable, Sequence
from statistics import NormalDist
from typing import NamedTuple

from rig.chances import chance_f, chance_t

ALARM = 0.01
"""Probability of a false alarm in a run, for all outputs and tests together."""
_SHARE, _THERMOMETERS = 0.3, 0.1
"""Share of `ALARM` for each of the three tests of an output, and for the test of thermometers."""


class Number(NamedTuple):
    """Mean and variance of one output's readings at one point.

    Attributes:
        mean: mean of the readings.
        variance: variance of one reading; 0 if there is only one.
        n: number of readings.

    """

    mean: float
    variance: float
    n: int


def threshold(points: int, outputs: int, windows: int) -> float:
    """p-value below which a single test gives a warning."""
    return ALARM * _SHARE / max(1, points * outputs * windows)


class NoiseTest:
    """Tests whether readings within a point scatter more than at the first points: F test of pooled variances.

    Args:
        points: number of points of the run.
        outputs: number of outputs of the bench.
        say: formats a value with its unit.

    """

    FIRST = 30
    WINDOWS = (4, 16, 48)
    LEAST = 1.25
    """Smallest ratio of standard deviations that is reported."""

    def __init__(self, points: int, outputs: int, say: Callable[[float], str]) -> None:
        self._say = say
        self._p = threshold(points, outputs, len(self.WINDOWS))
        self._first: list[float] = []
        self._recent: deque[float] = deque(maxlen=max(self.WINDOWS))
        self._df = self._before = 0.0

    @property
    def sd(self) -> float:
        """Standard deviation of one reading at the first points; 0 until there are enough."""
        return math.sqrt(sum(self._first) / len(self._first)) if len(self._first) >= self.FIRST else 0.0

    def add(self, number: Number) -> str:
        """Take the next point; returns the warning, "" if none."""
        if number.n < 2:
            return ""
        if len(self._first) < self.FIRST:
            self._first.append(number.variance)
            self._df = _df_of(self._first, number.n - 1)
            return ""
        self._recent.append(number.variance)
        before = self._before = self._before or sum(self._first) / len(self._first)
        if before <= 0.0:
            return ""
        recent = list(self._recent)
        for size in self.WINDOWS:
            if len(recent) < size:
                continue
            now = sum(recent[-size:]) / size
            ratio = now / before
            if ratio < self.LEAST**2:
                continue
            if chance_f(size * self._df, len(self._first) * self._df, ratio) < self._p:
                return (
                    f"has become {math.sqrt(ratio):.2g} times as noisy as at the first {self.FIRST} points: the sd of "
                    f"a reading is {self._say(math.sqrt(now))} at the last {size} points, it was "
                    f"{self._say(math.sqrt(before))}"
                )
        return ""


def _df_of(variances: list[float], most: float) -> float:
    """Effective degrees of freedom of one point's variance, from the scatter of variances; at most `most`.

    Variances scatter more if readings are correlated, or if noise depends on the setting.
    """
    n = len(variances)
    mean = sum(variances) / n
    if n < 5 or mean <= 0.0:
        return most
    scatter = sum((v - mean) ** 2 for v in variances) / (n - 1) / mean**2
    return most if scatter <= 0.0 else max(0.5, min(most, 2.0 / scatter))


class RepeatTest:
    """Tests whether outputs at repeated settings have shifted: t test of the mean difference from the first visit.

    The variance of the differences is half the mean squared successive difference (von Neumann), which a slow drift
    hardly affects. Its degrees of freedom are 2/3 of their number.

    Args:
        points: number of points of the run.
        outputs: number of outputs of the bench.
        say: formats a value with its unit.

    """

    WINDOWS = (10, 30)

    def __init__(self, points: int, outputs: int, say: Callable[[float], str]) -> None:
        self._say = say
        self._p = threshold(points, outputs, len(self.WINDOWS))
        self._firsts: dict[Hashable, float] = {}
        self._steps: deque[float] = deque(maxlen=max(self.WINDOWS))
        self._squares: deque[float] = deque(maxlen=max(self.WINDOWS))

    def forget(self) -> None:
        """Begin a new whole plot: first readings of other whole plots do not count."""
        self._firsts.clear()

    def add(self, key: Hashable, mean: float) -> str:
        """Take an observation at a setting; returns the warning, "" if none."""
        if key not in self._firsts:
            self._firsts[key] = mean
            return ""
        step = mean - self._firsts[key]
        self._squares.append((step - self._steps[-1]) ** 2 if self._steps else 0.0)
        self._steps.append(step)
        steps, squares = list(self._steps), list(self._squares)
        for size in self.WINDOWS:
            if len(steps) < size:
                continue
            shift = sum(steps[-size:]) / size
            variance = sum(squares[1 - size :]) / (2 * (size - 1))
            if variance <= 0.0:
                continue
            t = abs(shift) / math.sqrt(variance / size)
            if abs(shift) > math.sqrt(variance) and 2.0 * chance_t(size * 2.0 / 3.0, -t) < self._p:
                return (
                    f"has drifted by {self._say(shift)}: the mean over the last {size} repeated settings against the "
                    f"first readings there; a single difference has sd {self._say(math.sqrt(variance))}"
                )
        return ""


class PreviousTest:
    """Tests whether outputs deviate from a previous calibration by more than its errors and those of the readings
    explain.

    Args:
        points: number of points of the run.
        outputs: number of outputs of the bench.
        say: formats a value with its unit.

    """

    WINDOWS = (5, 20)

    def __init__(self, points: int, outputs: int, say: Callable[[float], str]) -> None:
        self._say = say
        self._z = -NormalDist().inv_cdf(threshold(points, outputs, len(self.WINDOWS)) / 4.0)
        self._recent: deque[tuple[float, float, float]] = deque(maxlen=max(self.WINDOWS))

    def forget(self) -> None:
        """Begin a new whole plot, which has an error of its own."""
        self._recent.clear()

    def add(self, residual: float, own: float, shared: float, reach: float) -> str:
        """Take a residual.

        Args:
            residual: output minus the prediction of the calibration.
            own: standard deviation of the error that is independent at every observation.
            shared: standard deviation of the error that is common to the observations of the window.
            reach: coverage factor for the shared error.

        Returns:
            The warning, "" if none.

        """
        self._recent.append((residual, own, reach * shared))
        for size in self.WINDOWS:
            if len(self._recent) < size:
                continue
            values = list(self._recent)[-size:]
            mean = sum([r for r, _, _ in values]) / size
            chance = self._z * math.sqrt(sum([o * o for _, o, _ in values])) / size
            allowed = chance + max([s for _, _, s in values])
            if abs(mean) > allowed:
                return (
                    f"has left its last calibration by {self._say(mean)} over the last {size} points; errors of both "
                    f"allow for {self._say(allowed)}"
                )
        return ""


class StillTest:
    """Tests whether a thermometer repeats one reading for too long: a thermometer that hangs looks like a steady
    temperature.

    The test compares with the frequency of equal successive readings before. Thermometers with a coarse resolution are
    left out: their frequency of change depends on where the temperature is between two of their steps.

    Args:
        points: number of points of the run.
        thermometers: number of thermometers of the bench.
        unit: of the readings, for people.

    """

    FEWEST = 30
    """Minimum number of pairs of successive readings."""
    COMMON = 0.3

    def __init__(self, points: int, thermometers: int, unit: str) -> None:
        self._unit = unit
        self._p = ALARM * _THERMOMETERS / max(1, points * thermometers)
        self._last: float | None = None
        self._pairs = self._same = self._run = 0

    def add(self, readings: Sequence[float]) -> str:
        """Take the readings of the next point; returns the warning, "" if none."""
        for reading in readings:
            if reading == self._last:
                self._run += 1
                continue
            if self._last is not None:
                self._pairs, self._same = self._pairs + self._run + 1, self._same + self._run
            self._last, self._run = reading, 0
        same, pairs = self._same + 1, self._pairs + 2
        if self._pairs < self.FEWEST or same / pairs > self.COMMON:
            return ""
        # probability of this many more, from the frequency so far (Laplace's rule of succession)
        if math.prod((same + i) / (pairs + i) for i in range(self._run)) >= self._p:
            return ""
        return (
            f"hangs: it has read {self._last:g} {self._unit} {self._run + 1} times in a row, and neighbouring "
            f"readings were the same in {self._same} of {self._pairs} cases before. Its readings since then are not to "
            "be trusted"
        )
