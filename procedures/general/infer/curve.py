"""The abscissa of a fitted curve from a new reading of its response, with an interval: inverse prediction.

The interval contains every x whose prediction interval for one new reading covers the reading y_0 (Graybill and Iyer,
Regression Analysis, 1994, section 6; for a straight line it is Fieller's):

    |y_0 - x(x) b| <= t(x) sqrt(sum of variances + x(x) C x(x)')

Variances are those of one new reading in a new whole plot, if the fit has whole plots. Degrees of freedom are
Satterthwaite's of the sum; those of a fit without whole plots are its own.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.errors import FitError
from rig.procedures.general.infer.calibration import CurveCalibration
from rig.procedures.general.infer.frames import FLAT, Frames, frames, turns

BAD_READING = "not a finite number"
_UNDEFINED = "the curve is undefined between the calibrated range and this value"
_STEP, _LAST = 127, 381  # steps of each part of the grid; number of its last place
_CHUNK, _STEPS, _SECANTS, _EPS = 32768, 200, 6, float(np.finfo(float).eps)


@dataclass(frozen=True, eq=False)
class InferredCurve:
    """Values of the variable, one for each reading; NaN with a reason in `flag` if undetermined.

    Attributes:
        value: (n,).
        sd: (n,) standard deviation, to first order.
        lo95: (n,) 95 % interval; NaN if unbounded.
        hi95: (n,).
        flag: (n,) empty without problems.
        df: (n,) degrees of freedom of `sd`.
    """

    value: FloatArray
    sd: FloatArray
    lo95: FloatArray
    hi95: FloatArray
    flag: NDArray[Any]
    df: FloatArray


def infer_curve(calibration: CurveCalibration, response: FloatArray) -> InferredCurve:
    """The variable of (n,) new readings of the response, where `calibration.fixed` has the values of all others.

    Each of these is one number, or (n,), one for each reading. Readings with values for which the curve cannot be
    inverted have the reason in their flag.

    Raises:
        FitError: the formula has no variable, several or categories; the error is unknown; or the curve is not
            monotonic over the calibrated range, or the stated one, for any of the known values.

    """
    n = len(response)
    of = frames(calibration, n)
    refused = of.refused != ""
    if n and refused.all():
        same = (of.refused == of.refused[0]).all()
        raise FitError(str(of.refused[0]) if same else turns(calibration))
    value, sd, lo95, hi95, df = (np.full(n, np.nan) for _ in range(5))
    found = InferredCurve(value, sd, lo95, hi95, of.refused, df)
    words = f"this calibration of {calibration.response} cannot be inverted: "
    found.flag[refused] = words + found.flag[refused]
    bad = ~refused & ~np.isfinite(response)
    found.flag[bad] = BAD_READING
    usable = np.flatnonzero(~refused & ~bad)
    fixed = {name: np.broadcast_to(values, n) for name, values in calibration.fixed.items()}
    every = _Rows(calibration.at(fixed), of.sign, of.sign * response)
    for start in range(0, len(usable), _CHUNK):
        rows = usable[start : start + _CHUNK]
        _infer(every.take(rows), of.take(rows), rows, found)
    return found


def _infer(rows: _Rows, of: Frames, place: IntArray, found: InferredCurve) -> None:
    """Put what is inferred from rows into `found`, where `place` says."""
    below, above = rows.curve(of.low) - rows.y, rows.curve(of.high) - rows.y
    inside = (below <= 0.0) & (above >= 0.0)
    name, (low, high), between = rows.calibration.variable, rows.calibration.limits, rows.calibration.between
    found.flag[place[~inside]] = (
        f"{name} is outside the calibrated {low:g} to {high:g}"
        if between is None
        else f"the curve does not reach this reading from {name} = {low:g} to {high:g} (--between)"
    )
    if not inside.any():
        return
    rows, of, place, below, above = rows.take(inside), of.take(inside), place[inside], below[inside], above[inside]
    at = _root(rows, 0.0, of.low, of.high, (of.low, below), _between(of.low, of.high, below, above))
    defined = np.isfinite(at)
    if not defined.all():
        found.flag[place[~defined]] = _UNDEFINED
        rows, of, place, at = rows.take(defined), of.take(defined), place[defined], at[defined]
    found.value[place] = at
    if rows.calibration.value_only:
        return
    derivatives = rows.calibration.rows(at)
    variance, found.df[place] = rows.calibration.reading_variance(derivatives)
    with np.errstate(divide="ignore", invalid="ignore"):
        near = 1.0 / np.abs(rows.calibration.slope(at))
        sd = np.sqrt(variance) * near
    found.sd[place] = np.where(np.isfinite(sd), sd, np.nan)
    half = rows.calibration.half_width(derivatives)
    for side, ends, word in ((-1.0, found.lo95, "lower"), (1.0, found.hi95, "upper")):
        ends[place] = end = _end(rows, of, at, half, near, side)
        open_ = place[np.isnan(end)]
        where = "near the calibrated range" if between is None else "before the curve turns"
        words = f"the 95 % interval has no {word} end {where}"
        found.flag[open_] = [f"{each}; {words}" if each else words for each in found.flag[open_]]


@dataclass(frozen=True, eq=False)
class _Rows:
    """Curves with positive slope, `sign` times the calibration's, of rows of known values of the other variables.

    Attributes:
        calibration: with (n,) known values.
        sign: (n,).
        y: (n,) readings, times the sign.
    """

    calibration: CurveCalibration
    sign: FloatArray
    y: FloatArray

    def take(self, rows: NDArray[Any] | slice) -> _Rows:
        """Some of the rows."""
        fixed = {name: np.asarray(values)[rows] for name, values in self.calibration.fixed.items()}
        return _Rows(self.calibration.at(fixed), self.sign[rows], self.y[rows])

    def curve(self, x: FloatArray) -> FloatArray:
        """(n,) rising curve. Raises `FitError` where it is undefined."""
        return np.asarray(self.sign * self.calibration.curve(x))

    def turned(self, x: FloatArray, slope: FloatArray) -> NDArray[np.bool_]:
        """(n,) whether the curve has another direction, or none, at n places, beside a (n,) slope."""
        return ~(self.sign * self.calibration.slope(x) >= -FLAT * slope)

    def above(self, x: FloatArray, side: float) -> FloatArray:
        """(n,) upper (`side` 1) or lower (-1) end of the 95 % prediction interval of a new reading, or the curve (0),
        minus the reading; NaN where the curve is undefined.
        """
        try:
            curve = self.curve(x) - self.y
            return curve + side * self.calibration.half_width(self.calibration.rows(x)) if side else curve
        except FitError:
            if len(x) == 1:
                return np.full(1, np.nan)
            half = len(x) // 2
            parts = (slice(None, half), slice(half, None))
            return np.concatenate([self.take(part).above(x[part], side) for part in parts])


def _root(
    rows: _Rows, side: float, low: FloatArray, high: FloatArray, known: tuple[FloatArray, FloatArray], x: FloatArray
) -> FloatArray:
    """(n,) where `rows.above` of a side, below 0 at `low` and above it at `high`, is 0; NaN where it is undefined.

    The secant method, within bounds that close in; where a step leaves them, and in every third after the first ones,
    the interval is halved.

    Args:
        rows: of n.
        side: of the interval.
        low: (n,) bounds.
        high: (n,)
        known: (n,) a place, and the value there.
        x: (n,) places to begin with.
    """
    root, which, (before, of_before) = np.full(len(x), np.nan), np.arange(len(x)), known
    least = 4.0 * _EPS * (high - low)
    for step in range(_STEPS):
        value = rows.above(x, side)
        under = value < 0.0
        low, high = np.where(under, x, low), np.where(under, high, x)
        middle = 0.5 * low + 0.5 * high
        if step > _SECANTS and step % 3 == 0:
            then = middle
        else:
            with np.errstate(divide="ignore", invalid="ignore"):
                then = x - value * (x - before) / (value - of_before)
            then = np.where((then >= low) & (then <= high), then, middle)  # one that is not a number is replaced, too
        there = np.abs(value) <= 4.0 * _EPS * np.abs(rows.y)  # the rest is rounding
        then = np.where(there, x, then)
        root[which] = np.where(np.isnan(value), np.nan, then)
        more = np.abs(then - x) > least + 4.0 * _EPS * np.maximum(np.abs(low), np.abs(high))
        more &= np.isfinite(value)
        before, of_before, x = x, value, then
        if more.all():
            continue
        if not more.any():
            break
        rows, which, low, high, least = rows.take(more), which[more], low[more], high[more], least[more]
        before, of_before, x = before[more], of_before[more], x[more]
    return root


def _end(rows: _Rows, of: Frames, at: FloatArray, half: FloatArray, near: FloatArray, side: float) -> FloatArray:
    """(n,) nearest x below (`side` -1) or above (1) `at` at which the reading leaves its prediction interval.

    It is looked for up to the next place of a grid, and where it is farther, from place to place. NaN for none.

    Args:
        rows: of n.
        of: their frames.
        at: (n,) inferred values.
        half: (n,) half-width of the prediction interval there.
        near: (n,) change of x for a change of the response.
        side: of the interval.
    """
    n, grid = len(at), _Grid(rows.calibration.limits, of.first, of.last)
    number = grid.beside(at, side)
    outer = grid.places(number, slice(None))
    found, inner, of_inner, of_outer = np.full(n, np.nan), at.copy(), -side * half, np.full(n, np.nan)

    def usable(which: IntArray) -> IntArray:
        """Those of the rows that have a next place before the curve turns."""
        which = which[(number[which] >= 0) & (number[which] <= _LAST)]
        beyond = (number[which] < _STEP) | (number[which] > 2 * _STEP)
        if rows.calibration.between is not None and beyond.any():
            with np.errstate(divide="ignore"):
                which = which[~(beyond & rows.take(which).turned(outer[which], 1.0 / near[which]))]
        return which

    far = usable(np.arange(n))
    with np.errstate(invalid="ignore"):
        guess = at + side * half * near
        close = far[side * (outer[far] - guess[far]) > 0.0]
    if close.size:
        low, high = (at, outer) if side > 0.0 else (outer, at)
        known = inner[close], of_inner[close]
        found[close] = _root(rows.take(close), -side, low[close], high[close], known, guess[close])
    # A search that ends at the next place has not seen the other side of the end.
    far = far[~(np.abs(found - outer) > 1e-9 * np.abs(at - outer))[far]]
    found[far] = np.nan
    ended: list[IntArray] = []
    while far.size:
        of_outer[far] = rows.take(far).above(outer[far], -side)
        out = side * of_outer[far] > 0.0
        ended.append(far[out])
        far = far[~out & np.isfinite(of_outer[far])]
        inner[far], of_inner[far] = outer[far], of_outer[far]
        number[far] += int(side)
        outer[far] = grid.places(number[far], far)
        far = usable(far)
    if ended and (rest := np.concatenate(ended)).size:
        pairs = (inner, of_inner), (outer, of_outer)
        (low, of_low), (high, of_high) = ((x[rest], y[rest]) for x, y in (pairs if side > 0.0 else pairs[::-1]))
        start = _between(low, high, of_low, of_high)
        found[rest] = _root(rows.take(rest), -side, low, high, (low, of_low), start)
    return found


def _between(low: FloatArray, high: FloatArray, of_low: FloatArray, of_high: FloatArray) -> FloatArray:
    """(n,) where a straight line from a value not above 0 at `low` to one not below it at `high` is 0."""
    rise = of_high - of_low
    return np.clip(low - of_low * (high - low) / np.where(rise > 0.0, rise, 1.0), low, high)


@dataclass(frozen=True, eq=False)
class _Grid:
    """Places at which ends of intervals are looked for: in the calibrated range, below and above it, evenly in each.

    Attributes:
        range: lowest and highest calibrated value.
        first: (n,) first place.
        last: (n,) last place.
    """

    range: tuple[float, float]
    first: FloatArray
    last: FloatArray

    def places(self, number: IntArray, rows: IntArray | slice) -> FloatArray:
        """(m,) places with numbers from 0 to `_LAST`, of m rows; outside, any."""
        part = np.clip(number // _STEP, 0, 2)
        low, high = self.range
        start = np.where(part == 0, self.first[rows], np.where(part == 1, low, high))
        stop = np.where(part == 0, low, np.where(part == 1, high, self.last[rows]))
        return np.where(number == _LAST, stop, start + (number - _STEP * part) * ((stop - start) / _STEP))

    def beside(self, at: FloatArray, side: float) -> IntArray:
        """(n,) number of the next place below (`side` -1) or above (1); -1 or `_LAST` + 1 for none."""
        low, high = self.range
        part = (at >= low) + (at >= high) * 1 if side > 0.0 else (at > low) + (at > high) * 1
        start = np.where(part == 0, self.first, np.where(part == 1, low, high))
        width = np.where(part == 0, low - self.first, np.where(part == 1, high - low, self.last - high))
        number = _STEP * part + np.floor(_STEP * (at - start) / np.where(width > 0.0, width, 1.0)).astype(np.int64)
        number += side < 0.0
        for _ in range(3):  # the place with this number may lie on either side of `at`, by rounding
            beyond = side * (self.places(number, slice(None)) - at) > 0.0
            number = np.where(beyond, number, number + int(side))
        beyond = side * (self.places(number, slice(None)) - at) > 0.0
        return np.where(beyond & (number <= _LAST), number, -1)
