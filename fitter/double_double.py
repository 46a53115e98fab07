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

from rig.fitter.arrays import FloatArray

_SPLITTER = 134217729.0  # 2^27 + 1: splits the 53 bits of a double
_HIGHEST_POWER = 64


@dataclass(frozen=True, eq=False)
class DoubleDouble:
    """Numbers of any one shape, hi + lo; |lo| is at most half a unit in the last place of hi.

    Sums, differences, products, quotients and whole powers up to 64, of NumPy's functions too, have about 30 digits;
    results below 1e-290 and everything else that NumPy computes are only as exact as in doubles.

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
        if method != "__call__" or options:
            return NotImplemented
        given = [_as(value) for value in inputs]
        if ufunc is np.power and (whole := _whole(given[1])) is not None:
            return given[0].power(whole)
        exact = _EXACT.get(ufunc)
        return exact(*given) if exact else DoubleDouble.of(ufunc(*(value.hi for value in given)))


def _as(value: DoubleDouble | ArrayLike) -> DoubleDouble:
    return value if isinstance(value, DoubleDouble) else DoubleDouble.of(value)


def _whole(exponent: DoubleDouble) -> int | None:
    """The exponent of a power by squaring; None where it is none."""
    value = float(exponent.hi.item()) if exponent.hi.size == 1 else np.nan
    return int(value) if value.is_integer() and abs(value) <= _HIGHEST_POWER else None


_EXACT: Mapping[np.ufunc, Callable[..., DoubleDouble]] = {
    np.add: DoubleDouble.__add__,
    np.subtract: DoubleDouble.__sub__,
    np.multiply: DoubleDouble.__mul__,
    np.divide: DoubleDouble.__truediv__,
    np.negative: DoubleDouble.__neg__,
}


def _two_sum(a: FloatArray, b: FloatArray) -> tuple[FloatArray, FloatArray]:
    """a + b rounded, and its rounding error (Knuth)."""
    s = a + b
    t = s - a
    return s, (a - (s - t)) + (b - t)


def _quick_sum(a: FloatArray, b: FloatArray) -> tuple[FloatArray, FloatArray]:
    """a + b rounded, and its rounding error, for |a| >= |b| (Dekker)."""
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
