"""Where a curve can be inverted: for one, or for each of many rows of known values of its other variables.

A curve is judged at many places of its variable. Known values of other variables may differ from row to row, and a
million rows cannot be judged one by one. Rows that lie together are judged together, at the corners of their box and
at some of themselves: where all agree by more than they differ from each other, all rows of the box have the same
frame. Otherwise the box is halved.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, replace
from itertools import pairwise, product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rig.fitter.arrays import FloatArray
from rig.fitter.errors import FitError
from rig.procedures.general.infer.calibration import CurveCalibration
from rig.procedures.general.infer.factored import EPS, LEAST_DIGITS

BEYOND = 0.02
"""Permitted distance of a value from the calibrated range, relative to its width: settings have errors."""

REACH = 1.0
"""Maximum distance of the end of an interval from the calibrated range, relative to its width."""

_EXACT = 1e-6  # minimum error relative to the curve's range, if the rows scatter less
_SLOPES, FLAT, _HALVINGS = 513, 1e-9, 30
_CORNERS, _SAMPLE = 4, 12  # most other variables of which a box has its corners looked at; rows looked at in a box
_MOST, _DIGITS, _NEARLY = 4, 2, 1e-9
"""Most ranges that a refusal names; digits of their ends, and how near an end is taken for a round number."""
_SOME_RANGE = "; state with --between LOW HIGH a range in which the curve does not turn"


@dataclass(frozen=True, eq=False)
class Frames:
    """How the curve of each of n rows is inverted.

    Attributes:
        sign: (n,) 1 where it increases, -1 where it decreases.
        low: (n,) lowest accepted value of the variable.
        high: (n,) highest.
        first: (n,) least place at which an end of an interval is looked for.
        last: (n,) greatest.
        refused: (n,) why it cannot be inverted; empty where it can.
    """

    sign: FloatArray
    low: FloatArray
    high: FloatArray
    first: FloatArray
    last: FloatArray
    refused: NDArray[np.object_]

    def take(self, rows: NDArray[Any]) -> Frames:
        """Those of some rows."""
        return Frames(*(getattr(self, each.name)[rows] for each in fields(self)))


def frames(calibration: CurveCalibration, n: int) -> Frames:
    """The frame of each of n rows; `calibration.fixed` has one value, or (n,), of each other variable.

    Raises:
        FitError: the formula has no variable, several or categories; the error is unknown; or the variable had one
            value only.
    """
    name = calibration.variable
    low, high = calibration.limits
    if not high > low:
        raise FitError(f"{name} had one value only when it was calibrated, {low:g}: there is no curve to invert")
    columns = [np.broadcast_to(values, n) for values in calibration.fixed.values()]
    known = np.column_stack(columns) if columns else np.zeros((n, 0))
    found, refused = np.full((n, 5), np.nan), np.full(n, "", dtype=object)
    for rows, frame in _judged(calibration, known):
        if isinstance(frame, str):
            refused[rows] = frame
        else:
            found[rows] = frame
    sign, accepted_low, accepted_high, first, last = found.T
    return Frames(sign, accepted_low, accepted_high, first, last, refused)


_Frame = tuple[float, float, float, float, float] | str
"""Sign, accepted range, places for ends of intervals; or why the curve cannot be inverted."""


def _judged(calibration: CurveCalibration, known: FloatArray) -> Iterator[tuple[NDArray[np.intp], _Frame]]:
    """Rows of (n, d) known values, and their common frame."""
    wide = np.maximum(np.ptp(known, axis=0), np.finfo(float).tiny) if len(known) else np.zeros(0)
    boxes = [np.arange(len(known))] if len(known) else []
    while boxes:
        rows = boxes.pop()
        values = known[rows]
        low, high = values.min(axis=0), values.max(axis=0)
        if (low == high).all():
            yield rows, _Look(calibration, values[:1]).frame_of_one()
            continue
        sample = values[np.linspace(0, len(rows) - 1, _SAMPLE).astype(np.intp)]
        corners = list(product(*zip(low, high, strict=True))) if len(low) <= _CORNERS else [low, high]
        common = _Look(calibration, np.vstack([*corners, sample])).frame()
        if common is not None:
            yield rows, common
            continue
        # Halves of the longest side, not of the rows: a far value of a sensor that failed is soon alone in its box.
        side = int(np.argmax((high - low) / wide))
        below = values[:, side] < 0.5 * low[side] + 0.5 * high[side]
        below = below if below.any() else values[:, side] <= low[side]
        boxes += [rows[below], rows[~below]]


@dataclass(frozen=True, eq=False)
class _Look:
    """The curve over its variable at p points of known values of the others.

    What a number does at points that lie together is known at all values between them if it stays on its side of a
    limit by more than the points differ. For one point this is the plain comparison.

    Attributes:
        calibration: of the curve.
        points: (p, d) values, in the order of `calibration.fixed`.
    """

    calibration: CurveCalibration
    points: FloatArray

    def frame_of_one(self) -> _Frame:
        """The frame of one point; one that cannot be decided is refused."""
        found = self.frame()
        return self._turns() if found is None else found

    def frame(self) -> _Frame | None:
        """The frame of all points; None if they differ, or are near to it."""
        low, high = self.calibration.limits
        few, sign = self._few_digits(low, high), self._direction(low, high)
        if few is None or (few is False and sign is None):
            return None
        if few:
            return few_digits(self.calibration, low, high)
        if not sign:
            return self._turns()
        room = BEYOND * (high - low)
        below, above = self._direction(low - room, low), self._direction(high, high + room)
        first, last = self._reach(low, -REACH * (high - low)), self._reach(high, REACH * (high - low))
        if below is None or above is None or first is None or last is None:
            return None
        return sign, low - room if below == sign else low, high + room if above == sign else high, first, last

    def _turns(self) -> str:
        """That the curves turn, with the ranges in which they do not, where these are the same at all points."""
        ranges = {replace(self, points=one[None, :])._ranges() for one in self.points}
        return turns(self.calibration, ranges.pop() if len(ranges) == 1 else _SOME_RANGE)

    def _ranges(self) -> str:
        """The ranges in which the curve of one point keeps its direction, as words that name the option."""
        low, high = self.calibration.limits
        x = np.linspace(low, high, _SLOPES)
        rising = np.sign(self._at(x, _slope)[0])
        if np.isnan(rising).any():
            return ""
        edges = [0, *(np.flatnonzero(np.diff(rising)) + 1).tolist(), len(x)]
        found = []
        for first, last in pairwise(edges):
            pair = _inward(x[first], x[last - 1], high - low)
            if rising[first] != 0 and pair[0] < pair[1] and self._direction(*pair):
                found.append(f"--between {pair[0]:.12g} {pair[1]:.12g}")
        if not found or len(found) > _MOST:
            return _SOME_RANGE
        return f"; say in which range it is: {' or '.join(found)}"

    def _direction(self, low: float, high: float) -> float | None:
        """1 if the curves increase everywhere, -1 if they decrease, 0 if neither or undefined; None in doubt."""
        x = np.linspace(low, high, _SLOPES)
        slope = self._at(x, _slope)
        steepest = np.abs(slope).max(axis=1)
        usable = np.isfinite(steepest) & (steepest > 0.0)
        if not usable.all():
            return None if usable.any() else 0.0
        least, most = _spread(slope)
        if (least >= -FLAT * steepest.min()).all():
            return 1.0
        if (most <= FLAT * steepest.min()).all():
            return -1.0
        flat = FLAT * steepest.max()
        return 0.0 if (most < -flat).any() and (least > flat).any() else None

    def _few_digits(self, low: float, high: float) -> bool | None:
        """Whether rounding leaves too few digits at all points; None in doubt."""
        lost = self._at(np.linspace(low, high, _SLOPES), _lost).max(axis=1)
        least, most = _spread(np.where(np.isnan(lost), 0.0, lost))  # an undefined curve is reported elsewhere
        return False if most <= 1.0 else True if least > 1.0 else None

    def _reach(self, end: float, step: float) -> float | None:
        """The place up to which ends of intervals are looked for: beyond the range as far as the formula is defined."""
        for _ in range(_HALVINGS):
            defined = np.isfinite(self._at(np.array([end + step]), _finite)).all(axis=1)
            if defined.any():
                return end + step if defined.all() else None
            step *= 0.5
        return end

    def _at(self, x: FloatArray, value: Callable[[CurveCalibration, FloatArray], FloatArray]) -> FloatArray:
        """(p, len(x)) values at (len(x),) places at every point; NaN at points where one of them is undefined."""
        p = len(self.points)
        known = dict(zip(self.calibration.fixed, np.repeat(self.points, len(x), axis=0).T, strict=True))
        try:
            return value(self.calibration.at(known), np.tile(x, p)).reshape(p, len(x))
        except FitError:
            if p == 1:
                return np.full((1, len(x)), np.nan)
            return np.vstack([replace(self, points=one[None, :])._at(x, value) for one in self.points])


def _spread(values: FloatArray) -> tuple[Any, Any]:
    """Bounds of what (p, ...) values at p points are between them: beyond the extremes by their difference."""
    least, most = values.min(axis=0), values.max(axis=0)
    if len(values) == 1:
        return least, most
    return least - (most - least), most + (most - least)


def _finite(calibration: CurveCalibration, x: FloatArray) -> FloatArray:
    """(n,) finite where the curve and its derivative are defined. Raises `FitError` where they are not."""
    return np.asarray(calibration.rows(x).sum(axis=1) + calibration.curve(x))


def _slope(calibration: CurveCalibration, x: FloatArray) -> FloatArray:
    """(n,) slope. Raises `FitError` outside the formula's domain, which the slope alone does not refuse."""
    calibration.curve(x)
    return calibration.slope(x)


def _lost(calibration: CurveCalibration, x: FloatArray) -> FloatArray:
    """(n,) rounding of the interval and of the curve at n places, `_SLOPES` for each point, relative to its limit."""
    h, curve = calibration.rows(x), calibration.curve(x)
    factor = calibration.factored
    variance = np.maximum(factor.variance(h) + calibration.variances.sum(), 0.0)
    off = EPS * (np.abs(h) @ np.abs(calibration.coefficients))
    width = np.repeat(np.ptp(curve.reshape(-1, _SLOPES), axis=1), _SLOPES)
    pairs = (factor.rounding(h), variance), (off, np.maximum(np.sqrt(variance), _EXACT * width))
    with np.errstate(divide="ignore", invalid="ignore"):  # a curve through every row has neither error nor rounding
        lost = [np.where(error == 0.0, 0.0, error / (LEAST_DIGITS * of)) for error, of in pairs]
    return np.asarray(np.maximum(*lost))


def turns(calibration: CurveCalibration, ranges: str = _SOME_RANGE) -> str:
    """That a curve turns, and what to do."""
    name, (low, high) = calibration.variable, calibration.limits
    return (
        f"{calibration.response} does not rise or fall all the way from {name} = {low:g} to {high:g}: a "
        f"reading has several values of {name}, and which is meant cannot be told{ranges}"
    )


def _inward(low: float, high: float, width: float) -> tuple[float, float]:
    """A range with ends of few digits inside another one."""
    step = 10.0 ** (math.floor(math.log10(width)) - _DIGITS)
    return math.ceil(low / step - _NEARLY) * step, math.floor(high / step + _NEARLY) * step


def too_few_digits(calibration: CurveCalibration, low: float, high: float) -> str:
    """Reason why rounding leaves too few digits of the interval or of the curve from `low` to `high`; "" if it does
    not.
    """
    try:
        few = (_lost(calibration, np.linspace(low, high, _SLOPES)) > 1.0).any()
    except FitError:
        return ""  # reported elsewhere
    return few_digits(calibration, low, high) if few else ""


def few_digits(calibration: CurveCalibration, low: float, high: float) -> str:
    """That rounding leaves too few digits, and what to do."""
    name, middle = calibration.variable, 0.5 * (low + high)
    without = " and the file has no covariance_factor" if calibration.factor is None else ""
    return (
        f"{name} runs from {low:.9g} to {high:.9g}, and in the terms {calibration.formula}{without} rounding leaves "
        f"too few digits of its interval; subtract about {middle:.7g} from {name} and fit again"
        f"{', or fit again as it is' if calibration.factor is None else ''}"
    )
