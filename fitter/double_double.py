"""Arithmetic with twice the digits of a double: a number is the unevaluated sum of two.

Error-free transformations (Dekker 1971; Knuth, The Art of Computer Programming, volume 2, section 4.2.2): a sum or a
product of doubles is a double and a rounding error that is itself a double. Only rounding to nearest is relied on, not
extended registers or fused multiplication. About 31 digits, at some twenty operations each; magnitudes must stay below
1e300.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fitter.arrays import FloatArray

_SPLITTER = 134217729.0  # 2^27 + 1: splits the 53 bits of a double
_HIGHEST_POWER = 64
_LARGEST_ANGLE = 1e8
_QUARTER_TURN = (1.5707963267948966, 6.123233995736766e-17, -1.4973849048591833e-33)  # pi/2, the sum of three
_LOG_2 = (0.6931471805599453, 2.3190468138462996e-17)
_HALVINGS = 9  # limit of an exponent for its series


@dataclass(frozen=True, eq=False)
class DoubleDouble:
    """Numbers of any one shape, hi + lo; |lo| is at most half a unit in the last place of hi.

    NumPy's arithmetic functions take it wherever they take an array, and so do those in `_UFUNCS`. All have about 30
    digits, but for results below 1e-290, a power of a number below zero that is no whole number up to 64, and sin and
    cos beyond 1e8 rad: they are only as exact as in doubles.
    """

    hi: FloatArray
    lo: FloatArray

    @classmethod
    def of(cls, values: ArrayLike) -> DoubleDouble:
        """These doubles without error."""
        hi = np.asarray(values, np.float64)
        return cls(hi, np.zeros_like(hi))

    def __getitem__(self, index: Any) -> DoubleDouble:
        return DoubleDouble(self.hi[index], self.lo[index])

    def __add__(self, other: DoubleDouble | ArrayLike) -> DoubleDouble:
        b = _as(other)
        s, e = _two_sum(self.hi, b.hi)
        t, f = _two_sum(self.lo, b.lo)
        s, e = _quick_sum(s, e + t)
        return DoubleDouble(*_quick_sum(s, e + f))

    def __neg__(self) -> DoubleDouble:
        return DoubleDouble(-self.hi, -self.lo)

    def __sub__(self, other: DoubleDouble | ArrayLike) -> DoubleDouble:
        return self + -_as(other)

    def __mul__(self, other: DoubleDouble | ArrayLike) -> DoubleDouble:
        b = _as(other)
        p, e = _two_product(self.hi, b.hi)
        return DoubleDouble(*_quick_sum(p, e + (self.hi * b.lo + self.lo * b.hi)))

    def __truediv__(self, other: DoubleDouble | ArrayLike) -> DoubleDouble:
        b = _as(other)
        first = self.hi / b.hi
        rest = self - b * first
        second = rest.hi / b.hi
        third = (rest - b * second).hi / b.hi
        return DoubleDouble(*_quick_sum(first, second)) + third

    def power(self, exponent: int) -> DoubleDouble:
        """Whole powers, by repeated squaring."""
        result, square, left = DoubleDouble.of(np.ones_like(self.hi)), self, abs(exponent)
        while left:
            if left & 1:
                result = result * square
            left >>= 1
            square = square * square if left else square
        return result if exponent >= 0 else DoubleDouble.of(1.0) / result

    def sum(self) -> DoubleDouble:
        """Sum over the first axis, by halving."""
        total = self
        while len(total.hi) > 1:
            half = len(total.hi) // 2
            odd = total[2 * half :]
            total = total[:half] + total[half : 2 * half]
            if len(odd.hi):
                total = DoubleDouble(*(np.concatenate(pair) for pair in ((total.hi, odd.hi), (total.lo, odd.lo))))
        return total[0]

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        operation = _UFUNCS.get(ufunc)
        if operation is None or method != "__call__" or options:
            return NotImplemented
        return operation(*(_as(value) for value in inputs))


def _as(value: DoubleDouble | ArrayLike) -> DoubleDouble:
    return value if isinstance(value, DoubleDouble) else DoubleDouble.of(value)


def _power(base: DoubleDouble, exponent: DoubleDouble) -> DoubleDouble:
    if exponent.hi.size == 1 and float(exponent.hi.item()).is_integer() and abs(exponent.hi.item()) <= _HIGHEST_POWER:
        return base.power(int(exponent.hi.item()))
    return _where(base.hi > 0.0, _exp(exponent * _log(base)), DoubleDouble.of(np.power(base.hi, exponent.hi)))


def _sqrt(x: DoubleDouble) -> DoubleDouble:
    """By one Newton step from the value in doubles."""
    root = np.sqrt(x.hi)
    rest = x - DoubleDouble.of(root) * root
    return DoubleDouble(*_quick_sum(root, np.where(root > 0.0, rest.hi / (2.0 * root), rest.hi)))


def _exp(x: DoubleDouble) -> DoubleDouble:
    """2^k exp(r), and exp(r) - 1 by its series at r / 2^9, squared nine times."""
    k = np.rint(x.hi / _LOG_2[0])
    r = (x - DoubleDouble(*map(np.asarray, _LOG_2)) * k) * 2.0**-_HALVINGS
    series = DoubleDouble.of(np.ones_like(x.hi))
    for n in range(10, 1, -1):
        series = r * series / float(n) + 1.0
    less_one = r * series
    for _ in range(_HALVINGS):
        less_one = less_one * 2.0 + less_one * less_one
    result, power = less_one + 1.0, np.nan_to_num(np.clip(k, -2000.0, 2000.0)).astype(np.int64)
    return DoubleDouble(np.ldexp(result.hi, power), np.ldexp(result.lo, power))


def _log(x: DoubleDouble) -> DoubleDouble:
    """By one Newton step for exp, with its second order, from the value in doubles."""
    first = DoubleDouble.of(np.log(x.hi))
    rest = x * _exp(-first) - 1.0
    return first + (rest - rest * rest * 0.5)


def _sin(x: DoubleDouble, quarters: int = 0) -> DoubleDouble:
    """sin(x + quarters pi/2): the series of the remainder after whole quarters of a turn."""
    k = np.rint(x.hi / _QUARTER_TURN[0])
    r = x
    for part in _QUARTER_TURN:
        r = r - DoubleDouble.of(k) * part
    square, one = r * r, DoubleDouble.of(np.ones_like(x.hi))
    sine, cosine = one, one
    for n in range(28, 0, -2):
        sine = one - square * sine / float(n * (n + 1))
        cosine = one - square * cosine / float(n * (n - 1))
    turned = np.mod(k + quarters, 4.0)
    series = _where(turned % 2.0 == 0.0, r * sine, cosine)
    series = _where(turned >= 2.0, -series, series)
    return _where(np.abs(x.hi) <= _LARGEST_ANGLE, series, DoubleDouble.of(np.cos(x.hi) if quarters else np.sin(x.hi)))


def _cos(x: DoubleDouble) -> DoubleDouble:
    return _sin(x, 1)


def _absolute(x: DoubleDouble) -> DoubleDouble:
    return _where(x.hi < 0.0, -x, x)


def _sign(x: DoubleDouble) -> DoubleDouble:
    return DoubleDouble.of(np.sign(x.hi))


def _maximum(a: DoubleDouble, b: DoubleDouble) -> DoubleDouble:
    """NaN if an operand is, as for arrays."""
    ahead = np.sign((a - b).hi)
    return _where(np.isnan(ahead), DoubleDouble.of(ahead), _where(ahead >= 0.0, a, b))


def _minimum(a: DoubleDouble, b: DoubleDouble) -> DoubleDouble:
    return -_maximum(-a, -b)


def _where(condition: Any, a: DoubleDouble, b: DoubleDouble) -> DoubleDouble:
    return DoubleDouble(np.where(condition, a.hi, b.hi), np.where(condition, a.lo, b.lo))


_UFUNCS: Mapping[np.ufunc, Callable[..., DoubleDouble]] = {
    np.add: DoubleDouble.__add__,
    np.subtract: DoubleDouble.__sub__,
    np.multiply: DoubleDouble.__mul__,
    np.divide: DoubleDouble.__truediv__,
    np.negative: DoubleDouble.__neg__,
    np.power: _power,
    np.log: _log,
    np.exp: _exp,
    np.sqrt: _sqrt,
    np.absolute: _absolute,
    np.sign: _sign,
    np.sin: _sin,
    np.cos: _cos,
    np.minimum: _minimum,
    np.maximum: _maximum,
}


def _two_sum(a: FloatArray, b: FloatArray) -> tuple[FloatArray, FloatArray]:
    """a + b rounded, and its rounding error (Knuth)."""
    s = a + b
    t = s - a
    return s, (a - (s - t)) + (b - t)


def _quick_sum(a: FloatArray, b: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The same for |a| >= |b| (Dekker)."""
    s = a + b
    return s, b - (s - a)


def _two_product(a: FloatArray, b: FloatArray) -> tuple[FloatArray, FloatArray]:
    """a * b rounded, and its rounding error (Veltkamp, Dekker)."""
    p = a * b
    a1, b1 = _upper_half(a), _upper_half(b)
    a2, b2 = a - a1, b - b1
    return p, ((a1 * b1 - p) + a1 * b2 + a2 * b1) + a2 * b2


def _upper_half(a: FloatArray) -> FloatArray:
    c = _SPLITTER * a
    return np.asarray(c - (c - a))
