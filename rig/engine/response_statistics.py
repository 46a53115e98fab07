"""Whether a sensor responds: tests that one output follows the settings of the bench.

These tests need no significance level. A working sensor follows its settings to one part in ten thousand and a
dead one not at all, so any threshold between the two will do.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import hypot, inf, sqrt
from operator import mul
from typing import NamedTuple

import numpy as np

Row = tuple[float, ...]
"""Columns of a simple model at one observation, the first of them 1."""

# Chosen: between a sensor that follows to one part in ten thousand and a dead one there is room for any of them.
_MODEL_ROWS = 200
_WINDOWS = (4, 8, 12)
_FROZEN = 3
_JUMPED = 3
_BEYOND_SCATTER = 50.0  # standard deviations
_SPANNED = 0.3  # of the range of each column, before a first fit
_ODD = 0.05  # of the output's range; a row farther off is not learned from
_TO_JUDGE_A_SLOPE, _SLOPE_OFF = 8, 0.2
_FOLLOWED = 0.99 * _SLOPE_OFF / sqrt(2 * _TO_JUDGE_A_SLOPE)
_EXACT, _ZERO = 1e-9, 1e-13
"""Smallest error of an observation that is assumed, relative to the range of the output; and the smallest singular
value that is not zero, relative to the largest.
"""


class _Expected(NamedTuple):
    """A prediction: its value, and the standard deviation of the fitted function there (not of a reading)."""

    value: float
    sd: float


@dataclass
class _Seen:
    """One of the last observations: setting, mean, whether all readings were equal, and the model's prediction."""

    row: Row
    mean: float
    still: bool
    expected: _Expected | None


class _Model:
    """The output as a linear function of the columns, fitted to the first observations.

    What these observations do not determine is unknown: a column may move the output over its `span` by as much as the
    output has moved so far. So a temperature that stands while the flow is swept predicts nothing for another one,
    even if it stands to the last digit and least squares has a solution.
    """

    def __init__(self, rows: Sequence[Row], outputs: Sequence[float], span: Sequence[float]) -> None:
        columns, y = np.array(rows), np.array(outputs)
        largest = np.abs(columns).max(axis=0)
        alike = columns / np.where(largest > 0.0, largest, 1.0)  # amperes beside the cube of a temperature
        left = y - alike @ np.linalg.lstsq(alike, y, rcond=1e-9)[0]
        total = float(np.sum((y - y.mean()) ** 2))
        self.explained = 1.0 - float(left @ left) / total if total > 0.0 else None
        rank = int(np.linalg.matrix_rank(alike, rtol=1e-9))
        self.scatter = float(np.sqrt(left @ left / max(1, len(y) - rank)))
        self.low, self.high = float(y.min()), float(y.max())
        reach = self.high - self.low
        self.certain = max(_BEYOND_SCATTER * self.scatter, 0.01 * reach)  # at least; see `_certain`
        self._error = max(self.scatter, _EXACT * reach) or 1.0
        moves = np.array(span) > 0.0
        scale = np.where(moves, span, np.maximum(largest, 1e-300))
        weighted = np.vstack([columns / scale / self._error, np.diag(moves / (reach or 1.0))])
        u, size, vt = np.linalg.svd(weighted, full_matrices=False)
        inverse = np.divide(1.0, size, out=np.zeros_like(size), where=size > size[0] * _ZERO)
        root = vt.T * inverse / scale[:, None]
        solved = root @ (u.T @ np.concatenate([y / self._error, np.zeros(len(scale))]))
        self._columns: list[list[float]] = root.T.tolist()
        self._solved: list[float] = solved.tolist()

    def expects(self, row: Row) -> _Expected | None:
        """Predicted output at a setting; None where it is less certain than an observation."""
        # a few columns: numpy would take longer to begin than this takes
        sd = hypot(*[sum(map(mul, row, column)) for column in self._columns])
        return None if sd > self._error else _Expected(sum(map(mul, row, self._solved)), sd)


class ResponseTest:
    """Fits the output to the settings at the first points, and tests whether later points follow the fit.

    Args:
        span: range of each column over the whole run list.
        least_jump: smallest jump to report, as a fraction of the output's span.
        say: formats a value with its unit.

    """

    def __init__(self, span: Sequence[float], least_jump: float, say: Callable[[float], str]) -> None:
        self._span, self._least_jump, self._say = span, least_jump, say
        self._rows: list[Row] = []
        self._outputs: list[float] = []
        self._recent: deque[_Seen] = deque(maxlen=max(_WINDOWS))
        self._predicted: deque[float] = deque(maxlen=max(_WINDOWS))
        self._off_by: deque[float] = deque(maxlen=max(_WINDOWS))
        self._model: _Model | None = None
        self._next_fit = 12
        self._noisy = False
        self._off = 0

    def add(self, row: Row, mean: float, variance: float, *, new_whole_plot: bool) -> str:
        """Take an observation.

        Args:
            row: the model's columns.
            mean: mean of the output.
            variance: variance of its readings.
            new_whole_plot: offsets may differ from what came before.

        Returns:
            The warning, "" if none.

        """
        if new_whole_plot:
            self._recent.clear()
            self._predicted.clear()
            self._off_by.clear()
        self._noisy |= variance > 0.0
        expected = None if self._model is None else self._model.expects(row)
        seen = _Seen(row, mean, variance == 0.0, expected)
        self._recent.append(seen)
        self._compare(seen)
        if self._follows():
            said, self._off = "", 0
        else:
            last = list(self._recent)
            said = self._frozen(last) or self._deaf(last) or self._jumped(last) or self._weak(last)
        if not said and len(self._rows) < _MODEL_ROWS and self._believable(mean, expected):
            self._rows.append(row)
            self._outputs.append(mean)
            said = self._learn()
        return said

    def _compare(self, seen: _Seen) -> None:
        """Keep the prediction of an observation and its distance from it; without one it is infinitely far off."""
        value = inf if seen.expected is None else seen.expected.value
        self._predicted.append(value)
        self._off_by.append(abs(seen.mean - value))

    def _follows(self) -> bool:
        """Whether the output follows its model so closely that none of the tests below can find anything.

        It is cheaper than they are. `_frozen` needs a point without scatter; `_jumped` a last point that is off;
        `_deaf` and `_weak` predictions in a window that differ by more than is certain. If they differ by `should`,
        and no mean is off by more than a fraction `_FOLLOWED` of it, the output moved by more than a tenth of it, and
        a slope of n points differs from 1 by at most sqrt(2 n) times that fraction.
        """
        model, off = self._model, self._off_by
        if model is None or len(off) < max(_WINDOWS) or self._recent[-1].still:
            return False
        most = max(off)
        if most == inf or off[-1] > self._least_jump * (model.high - model.low):
            return False
        enough = max(model.certain, most / _FOLLOWED)
        predicted = list(self._predicted)
        for size in _WINDOWS:
            some = predicted[-size:]
            spread = max(some) - min(some)
            if spread >= enough:
                return True  # a longer window spreads at least as far
            if spread > model.certain:
                return False
        return True

    def _believable(self, mean: float, expected: _Expected | None) -> bool:
        """Whether an observation is good enough to be added to the fit."""
        model = self._model
        return model is None or expected is None or abs(mean - expected.value) <= _ODD * (model.high - model.low)

    def _frozen(self, last: list[_Seen]) -> str:
        """Test for a frozen output: all readings equal at different settings, although the sensor had noise before."""
        last = last[-_FROZEN:]
        if not self._noisy or len(last) < _FROZEN or not (last[0].still and all(s.still for s in last)):
            return ""
        if len({s.mean for s in last}) > 1 or len({s.row for s in last}) == 1:
            return ""
        return f"is frozen: every reading at the last {_FROZEN} points was {self._say(last[0].mean)}"

    def _learn(self) -> str:
        """Fit again from time to time as points are added; warns if the output never followed the settings."""
        n = len(self._rows)
        if n < self._next_fit:
            return ""
        reached = [max(column) - min(column) for column in zip(*self._rows, strict=True)]
        if any(r < _SPANNED * s for r, s in zip(reached, self._span, strict=True)):
            self._next_fit = n + 5
            return ""
        self._next_fit = max(n + 1, min(_MODEL_ROWS, int(n * 1.5)))
        model = _Model(self._rows, self._outputs, self._span)
        if model.explained is None:
            return f"does not follow the settings: it read {self._say(model.low)} at all {n} points so far"
        if model.explained < 0.5:
            return f"does not follow the settings: they explain {100 * model.explained:.0f} % of what it read so far"
        self._model = model
        self._predicted.clear()
        self._off_by.clear()
        for seen in self._recent:
            seen.expected = model.expects(seen.row)
            self._compare(seen)
        return ""

    def _deaf(self, last: list[_Seen]) -> str:
        """Test for an output that stays constant although the settings should have moved it."""
        model = self._model
        for size in _WINDOWS:
            some = last[-size:]
            expected = [s.expected for s in some if s.expected is not None]
            if model is None or len(expected) < size:
                break
            should = _range(expected)
            if should <= _certain(model, expected):
                continue
            means = [s.mean for s in some]
            did = max(means) - min(means)
            if did < 0.1 * should:
                stays = f"{self._say(some[-1].mean)}{_at_rail(model, some[-1].mean)}"
                return (
                    f"does not follow the settings: the last {size} should have moved it by {self._say(should)}, "
                    f"and it stays at {stays}"
                )
        return ""

    def _weak(self, last: list[_Seen]) -> str:
        """Test for a changed sensitivity, three times in succession, so that one outlier causes no warning."""
        model, some = self._model, last[-_TO_JUDGE_A_SLOPE:]
        expected = [s.expected for s in some if s.expected is not None]
        slope, error, should = 1.0, 0.0, 0.0
        if model is not None and len(expected) == _TO_JUDGE_A_SLOPE:
            should = _range(expected)
            if should > _certain(model, expected):
                slope, error = _slope([e.value for e in expected], [s.mean for s in some])
        off = abs(slope - 1.0) > _SLOPE_OFF and error < 0.01 * should
        self._off = self._off + 1 if off else 0
        if self._off < _JUMPED:
            return ""
        return f"follows the settings with {100 * slope:.0f} % of what it did before, over {len(some)} points"

    def _jumped(self, last: list[_Seen]) -> str:
        """Test for a jump: several points in succession far from the fit."""
        model, some = self._model, last[-_JUMPED:]
        off = [(s.mean - s.expected.value, s.expected.sd) for s in some if s.expected is not None]
        if model is None or len(off) < _JUMPED:
            return ""
        least = self._least_jump * (model.high - model.low)
        if not all(abs(by) > max(_BEYOND_SCATTER * hypot(model.scatter, sd), least) for by, sd in off):
            return ""
        rail = _at_rail(model, some[-1].mean)
        return f"reads {self._say(off[-1][0])} away from what its settings gave before, {_JUMPED} points in a row{rail}"


def _range(expected: Sequence[_Expected]) -> float:
    values = [e.value for e in expected]
    return max(values) - min(values)


def _certain(model: _Model, expected: Sequence[_Expected]) -> float:
    """Smallest predicted change that the output must follow."""
    worst = max([e.sd for e in expected])
    return max(_BEYOND_SCATTER * hypot(model.scatter, worst), 0.01 * (model.high - model.low))


def _slope(expected: list[float], read: list[float]) -> tuple[float, float]:
    """Slope of the readings against the predictions, and the rms residual of this line."""
    n = len(expected)
    mean_x, mean_y = sum(expected) / n, sum(read) / n
    x, y = [e - mean_x for e in expected], [r - mean_y for r in read]
    slope = sum([a * b for a, b in zip(x, y, strict=True)]) / sum([a * a for a in x])
    return slope, sqrt(sum([(b - slope * a) ** 2 for a, b in zip(x, y, strict=True)]) / n)


def _at_rail(model: _Model, value: float) -> str:
    furthest = max(abs(model.low), abs(model.high))
    return ", further out than anything it read before: is it at a rail?" if abs(value) > 1.05 * furthest else ""
