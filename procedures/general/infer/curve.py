"""The abscissa of a fitted curve from a new reading of its response, with an interval: inverse prediction.

The interval contains every x whose prediction interval for one new reading covers the reading y_0 (Graybill and Iyer,
Regression Analysis, 1994, section 6; for a straight line it is Fieller's):

    |y_0 - x(x) b| <= t(x) sqrt(sum of variances + x(x) C x(x)')

Variances are those of one new reading in a new whole plot, if the fit has whole plots. Degrees of freedom are
Satterthwaite's of the sum; those of a fit without whole plots are its own.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fitter.arrays import FloatArray
from fitter.errors import FitError
from procedures.general.infer.calibration import CurveCalibration
from procedures.general.infer.factored import EPS, LEAST_DIGITS

BEYOND = 0.02
"""Permitted distance of a value from the calibrated range, relative to its width: settings have errors."""

REACH = 1.0
"""Maximum distance of the end of an interval from the calibrated range, relative to its width."""

BAD_READING = "not a finite number"
_EXACT = 1e-6  # minimum error relative to the curve's range, if the rows scatter less
_GRID, _SLOPES, _STEPS, _CHUNK, _FLAT = 128, 513, 100, 8192, 1e-9
_MOST, _DIGITS, _NEARLY = 4, 2, 1e-9
"""Most ranges that a refusal names; digits of their ends, and how near an end is taken for a round number."""


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
    """The variable of (n,) new readings of the response.

    Raises:
        FitError: the formula has no variable, several or categories; the error is unknown; or the curve is not
            monotonic over the calibrated range, or the stated one.

    """
    band = _Band.of(calibration)
    parts = [band.infer(response[i : i + _CHUNK]) for i in range(0, max(len(response), 1), _CHUNK)]
    names = ("value", "sd", "lo95", "hi95", "flag", "df")
    return InferredCurve(**{name: np.concatenate([getattr(part, name) for part in parts]) for name in names})


@dataclass(frozen=True, eq=False)
class _Band:
    """The curve with positive slope: `sign` times it, with the half-width of its prediction interval."""

    calibration: CurveCalibration
    sign: float
    inner: tuple[float, float]
    grid: FloatArray

    @staticmethod
    def of(calibration: CurveCalibration) -> _Band:
        name = calibration.variable
        low, high = calibration.limits
        if not high > low:
            raise FitError(f"{name} had one value only when it was calibrated, {low:g}: there is no curve to invert")
        if few := too_few_digits(calibration, low, high):
            raise FitError(few)
        sign = _direction(calibration, low, high)
        if sign == 0.0:
            raise FitError(
                f"{calibration.response} does not rise or fall all the way from {name} = {low:g} to {high:g}: a "
                f"reading has several values of {name}, and which is meant cannot be told"
                f"{_options(calibration, low, high)}"
            )
        room = BEYOND * (high - low)
        first = low - room if _direction(calibration, low - room, low) == sign else low
        last = high + room if _direction(calibration, high, high + room) == sign else high
        grid = _grid(calibration, low, high)
        if calibration.between is not None:  # beyond the turn a reading comes again: no end is looked for there
            grid = grid[
                (grid >= _turn(calibration, low, grid[0], sign)) & (grid <= _turn(calibration, high, grid[-1], sign))
            ]
        return _Band(calibration, sign, (first, last), grid)

    def infer(self, response: FloatArray) -> InferredCurve:
        name, n = self.calibration.variable, len(response)
        low, high = self.calibration.limits
        flag = np.full(n, "", dtype=object)
        flag[~np.isfinite(response)] = BAD_READING
        ends = self.curve(np.array(self.inner))
        y = self.sign * response
        outside = (flag == "") & ~((y >= ends[0]) & (y <= ends[1]))
        flag[outside] = (
            f"{name} is outside the calibrated {low:g} to {high:g}"
            if self.calibration.between is None
            else f"the curve does not reach this reading from {name} = {low:g} to {high:g} (--between)"
        )
        usable = flag == ""
        value, sd, low95, high95, df = (np.full(n, np.nan) for _ in range(5))
        found = InferredCurve(value, sd, low95, high95, flag, df)
        if not usable.any():
            return found
        y = y[usable]
        at = _root(np.full(len(y), self.inner[0]), np.full(len(y), self.inner[1]), lambda x: self.curve(x) - y)
        found.value[usable], found.sd[usable] = at, self.sd(at)
        found.df[usable] = self.calibration.reading_variance(self.calibration.rows(at))[1]
        found.lo95[usable], found.hi95[usable] = self.lower(at, y), self.upper(at, y)
        for limits, side in ((found.lo95, "lower"), (found.hi95, "upper")):
            open_ = usable & np.isnan(limits)
            where = "near the calibrated range" if self.calibration.between is None else "before the curve turns"
            words = f"the 95 % interval has no {side} end {where}"
            flag[open_] = [f"{each}; {words}" if each else words for each in flag[open_]]
        return found

    def curve(self, x: FloatArray) -> FloatArray:
        """(n,) rising curve."""
        return np.asarray(self.sign * self.calibration.curve(x))

    def edge(self, x: FloatArray, side: float) -> FloatArray:
        """(n,) upper (`side` 1) or lower (-1) end of the 95 % prediction interval of one new reading."""
        half = self.calibration.half_width(self.calibration.rows(x))
        return np.asarray(self.curve(x) + side * half)

    def sd(self, x: FloatArray) -> FloatArray:
        """(n,) standard deviation of x, to first order; NaN where the curve is horizontal."""
        slope = np.abs(self.calibration.slope(x))
        with np.errstate(divide="ignore", invalid="ignore"):
            sd = np.sqrt(self.calibration.reading_variance(self.calibration.rows(x))[0]) / slope
        return np.where(np.isfinite(sd), sd, np.nan)

    def lower(self, at: FloatArray, y: FloatArray) -> FloatArray:
        """(n,) nearest x below `at` at which the reading leaves the prediction interval; NaN for none."""
        past = self.edge(self.grid, 1.0)[None, :] < y[:, None]
        past &= self.grid[None, :] < at[:, None]
        last = past.shape[1] - 1 - np.argmax(past[:, ::-1], axis=1)
        start, stop = self.grid[last], np.minimum(self.grid[np.minimum(last + 1, len(self.grid) - 1)], at)
        return self._end(np.asarray(past.any(axis=1)), at, start, stop, lambda x: self.edge(x, 1.0) - y)

    def upper(self, at: FloatArray, y: FloatArray) -> FloatArray:
        """As `lower`, above."""
        past = self.edge(self.grid, -1.0)[None, :] > y[:, None]
        past &= self.grid[None, :] > at[:, None]
        first = np.argmax(past, axis=1)
        start, stop = np.maximum(self.grid[np.maximum(first - 1, 0)], at), self.grid[first]
        return self._end(np.asarray(past.any(axis=1)), at, start, stop, lambda x: self.edge(x, -1.0) - y)

    @staticmethod
    def _end(closed: NDArray[np.bool_], at: FloatArray, start: FloatArray, stop: FloatArray, rise: _Rise) -> FloatArray:
        found = _root(np.where(closed, start, at), np.where(closed, stop, at), rise)
        return np.where(closed, found, np.nan)


_Rise = Callable[[FloatArray], FloatArray]


def _root(low: FloatArray, high: FloatArray, rise: _Rise) -> FloatArray:
    """(n,) where `rise`, not above 0 at `low` and not below it at `high`, is 0: by the Illinois method.

    Regula falsi in which the value at an end that stays is halved, so that both ends close in.
    """
    at_low, at_high = rise(low), rise(high)
    x, kept = low, np.zeros(len(low))
    for _ in range(_STEPS):
        apart = at_high - at_low
        before, x = x, np.clip(high - at_high * (high - low) / np.where(apart > 0.0, apart, 1.0), low, high)
        value = rise(x)
        under = value < 0.0
        at_high = np.where(under & (kept > 0), 0.5 * at_high, at_high)
        at_low = np.where(~under & (kept < 0), 0.5 * at_low, at_low)
        low, at_low = np.where(under, x, low), np.where(under, value, at_low)
        high, at_high = np.where(under, high, x), np.where(under, at_high, value)
        kept = np.where(under, 1.0, -1.0)
        if np.all(np.abs(x - before) <= 4.0 * np.finfo(float).eps * np.maximum(np.abs(low), np.abs(high))):
            break
    return np.asarray(x)


def _direction(calibration: CurveCalibration, low: float, high: float) -> float:
    """1 if the curve is increasing everywhere, -1 if decreasing, 0 if neither or undefined."""
    try:
        x = np.linspace(low, high, _SLOPES)
        calibration.curve(x)  # it alone refuses values outside the formula's domain
        slope = calibration.slope(x)
    except FitError:
        return 0.0
    steepest = np.abs(slope).max()
    if steepest == 0.0 or not np.isfinite(steepest):
        return 0.0
    for sign in (1.0, -1.0):
        if (sign * slope >= -_FLAT * steepest).all():
            return sign
    return 0.0


def _turn(calibration: CurveCalibration, end: float, far: float, sign: float) -> float:
    """The last place on the way from an end of a range to a far one where the curve keeps its direction."""
    x = np.linspace(end, far, _SLOPES)
    slope = sign * calibration.slope(x)
    kept = slope >= -_FLAT * np.nanmax(np.abs(slope), initial=0.0)
    return float(x[max(int(np.argmin(kept)) - 1, 0)] if not kept.all() else far)


def _options(calibration: CurveCalibration, low: float, high: float) -> str:
    """The ranges in which a curve keeps its direction, as words that name the option; "" if there are none."""
    try:
        x = np.linspace(low, high, _SLOPES)
        calibration.curve(x)
        rising = np.sign(calibration.slope(x))
    except FitError:
        return ""
    edges = [0, *(np.flatnonzero(np.diff(rising)) + 1).tolist(), len(x)]
    found = []
    for first, last in pairwise(edges):
        pair = _inward(x[first], x[last - 1], high - low)
        if rising[first] != 0 and pair[0] < pair[1] and _direction(calibration, *pair) != 0.0:
            found.append(f"--between {pair[0]:.12g} {pair[1]:.12g}")
    if not found or len(found) > _MOST:
        return "; state with --between LOW HIGH a range in which the curve does not turn"
    return f"; say in which range it is: {' or '.join(found)}"


def _inward(low: float, high: float, width: float) -> tuple[float, float]:
    """A range with ends of few digits inside another one."""
    step = 10.0 ** (math.floor(math.log10(width)) - _DIGITS)
    return math.ceil(low / step - _NEARLY) * step, math.floor(high / step + _NEARLY) * step


def too_few_digits(calibration: CurveCalibration, low: float, high: float) -> str:
    """Reason why rounding leaves too few digits of the interval or of the curve from `low` to `high`; "" if it does
    not.
    """
    try:
        x = np.linspace(low, high, _SLOPES)
        h, curve = calibration.rows(x), calibration.curve(x)
    except FitError:
        return ""  # reported elsewhere
    factor = calibration.factored
    variance = factor.variance(h) + calibration.variances.sum()
    off = EPS * (np.abs(h) @ np.abs(calibration.coefficients))
    least = np.maximum(np.sqrt(np.maximum(variance, 0.0)), _EXACT * np.ptp(curve))
    if (factor.rounding(h) <= LEAST_DIGITS * variance).all() and (off <= LEAST_DIGITS * least).all():
        return ""
    name, middle = calibration.variable, 0.5 * (low + high)
    without = " and the file has no covariance_factor" if calibration.factor is None else ""
    return (
        f"{name} runs from {low:.9g} to {high:.9g}, and in the terms {calibration.formula}{without} rounding leaves "
        f"too few digits of its interval; subtract about {middle:.7g} from {name} and fit again"
        f"{', or fit again as it is' if calibration.factor is None else ''}"
    )


def _grid(calibration: CurveCalibration, low: float, high: float) -> FloatArray:
    """Places for the search of interval ends: beyond the range as far as the formula is defined."""
    first, last, step = low, high, REACH * (high - low)
    for _ in range(30):
        first = low - step if first == low and _defined(calibration, low - step) else first
        last = high + step if last == high and _defined(calibration, high + step) else last
        step *= 0.5
    return np.unique(np.concatenate([np.linspace(*pair, _GRID) for pair in ((first, low), (low, high), (high, last))]))


def _defined(calibration: CurveCalibration, x: float) -> bool:
    try:
        return bool(
            np.isfinite(calibration.rows(np.array([x]))).all() and np.isfinite(calibration.curve(np.array([x]))).all()
        )
    except FitError:
        return False
