"""Values with their errors, as they are printed: an uncertainty to two significant digits, a value to its last place.

All arithmetic is decimal, on the shortest decimal number that stands for a float: what a person reads is what is
rounded, and 2.675 is a tie, as it looks.

Rules. A tie of an uncertainty goes up (away from zero), a tie of a value to the even digit (ISO 80000-1, annex B). If
rounding would reduce an uncertainty by more than 5 %, it is rounded up (EA-4/02, 6.3); with two digits it never does.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from decimal import ROUND_DOWN, ROUND_HALF_EVEN, ROUND_HALF_UP, ROUND_UP, Context, Decimal

import numpy as np
from numpy.typing import ArrayLike

from rig.fitter.errors import FitError

DIGITS = 2
"""Significant digits of an uncertainty, at most (JCGM 100, 7.2.6; EA-4/02, 6.3)."""
MOST_LOSS = Decimal("0.05")
_LEAST_PLACE, _LEAST_POSITION, _LARGEST_POSITION = -9, -3, 7
_EXACT = Context(prec=700)
"""Digits enough for any sum of a place and a float."""
_SHIFT = 0.1
"""Standard errors of a curve by which rounded coefficients may move it."""
_OF_A_DOUBLE, _UNKNOWN, _LONGEST = 17, 8, 12
"""Digits of a double; of a value whose error is unknown; in front of the point of a number without a power of ten."""
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(frozen=True)
class Rounded:
    """A value with its uncertainty, as they are printed.

    Attributes:
        value: rounded to the last place of the uncertainty.
        uncertainty: rounded to its significant digits.

    """

    value: Decimal
    uncertainty: Decimal

    @property
    def exponent(self) -> int:
        """Power of ten in front of which both numbers stand; 0 where they are printed without one.

        One is needed for very small and very large numbers, and where the last significant digit is left of the
        decimal point: 1200 would not tell whether its zeros count.
        """
        place = _place(self.uncertainty)
        largest = max(abs(self.value), self.uncertainty).adjusted()
        plain = _LEAST_PLACE <= place <= 0 and _LEAST_POSITION <= largest < _LARGEST_POSITION
        return 0 if plain else largest

    @property
    def value_text(self) -> str:
        """Decimal digits of the value, without the power of ten."""
        return _digits(self.value, self.exponent)

    @property
    def uncertainty_text(self) -> str:
        """Decimal digits of the uncertainty, without the power of ten."""
        return _digits(self.uncertainty, self.exponent)

    @property
    def power_text(self) -> str:
        """Such as "10⁻⁵"; empty if there is none."""
        return f"10{str(self.exponent).translate(_SUPERSCRIPTS)}" if self.exponent else ""

    @property
    def text(self) -> str:
        """Both, such as "12.345 ± 0.021" or "(1.234 ± 0.021) × 10⁻⁵"."""
        both = f"{self.value_text} ± {self.uncertainty_text}"
        return f"({both}) × {self.power_text}" if self.exponent else both


def rounded(value: float, uncertainty: float, digits: int = DIGITS) -> Rounded:
    """Round a value by its uncertainty.

    Raises:
        FitError: a number is not finite, or the uncertainty not positive.

    Example:
        >>> rounded(5.0012345, 0.000117).text
        '5.00123 ± 0.00012'

    """
    least = rounded_uncertainty(uncertainty, digits)
    return Rounded(rounded_to(value, _place(least)), least)


def rounded_uncertainty(uncertainty: float, digits: int = DIGITS) -> Decimal:
    """An uncertainty with so many significant digits.

    Raises:
        FitError: it is not finite, or not positive.

    """
    exact = shortest(uncertainty)
    if exact <= 0:
        raise FitError(f"an uncertainty of {uncertainty:g} has no significant digits: it must be more than 0")
    unit = _unit(exact.adjusted() - digits + 1)
    near = exact.quantize(unit, ROUND_HALF_UP, _EXACT)
    if near < exact * (1 - MOST_LOSS):
        near = exact.quantize(unit, ROUND_UP, _EXACT)
    # 0.0996 becomes 0.100: one digit too many.
    return near.quantize(_unit(near.adjusted() - digits + 1), ROUND_HALF_UP, _EXACT)


def rounded_to(value: float, place: int) -> Decimal:
    """A value rounded to a decimal place: -3 is the third after the point.

    Raises:
        FitError: it is not finite.

    """
    near = shortest(value).quantize(_unit(place), ROUND_HALF_EVEN, _EXACT)
    return abs(near) if near == 0 else near


def with_error(value: float | None, error: float | None, *, guard: int = 0, sign: bool = False) -> tuple[str, str]:
    """A value and its standard error, or half an interval, as text: the error says how many digits the value has.

    The error has two significant digits and the value the same last decimal place; both are printed to the unit where
    that place is left of the point, and with a power of ten each if they are very small or large. An error of 0 leaves
    15 digits of the value, one that is unknown or infinite 8. A dash stands for what is unknown.

    Args:
        value: of anything.
        error: of it, in its unit.
        guard: digits of the value beyond the last place of its error, as `guard_digits` gives them.
        sign: whether a positive value has a plus sign.
    """
    if value is None or math.isnan(value):
        return "-", "-"
    if error is None or not 0.0 < error < math.inf or math.isinf(value):
        digits = _OF_A_DOUBLE - 2 if error == 0.0 else _UNKNOWN
        return _signed(f"{value:.{digits}g}", sign), "0" if error == 0.0 else "inf" if error == math.inf else "-"
    exact, shown = shortest(value), rounded_uncertainty(error)
    wanted = _place(shown) - guard
    plain = _place(shown) >= _LEAST_PLACE and max(exact.adjusted(), shown.adjusted()) < _LONGEST
    if plain and _place(shown) > 0:
        shown = rounded_to(error, 0)
    place = _place(shown)
    last = max(min(place, wanted), exact.adjusted() + 1 - _OF_A_DOUBLE)
    near = rounded_to(value, last)
    while last < place and near == (shorter := near.quantize(_unit(last + 1), ROUND_DOWN, _EXACT)):
        near, last = shorter, last + 1
    return _signed(_printed(near, plain), sign), _printed(shown, plain)


def guard_digits(covariance: ArrayLike) -> int:
    """Digits of coefficients of one fit beyond those of their standard errors, so that a person may copy them.

    Correlated coefficients say more of the curve together than each of itself. Those rounded by their standard errors
    alone would move the curve by many of its own (JCGM 100, 7.2.6). With these digits it moves by a tenth of its
    standard error at most, root mean square, wherever that is: the sum of the variance inflation factors bounds it.

    Args:
        covariance: (k, k) of the coefficients, in any units.

    Example:
        >>> guard_digits([[1.0, 0.0], [0.0, 4.0]]), guard_digits([[1.0, 0.99999], [0.99999, 1.0]])
        (0, 2)

    """
    of = np.asarray(covariance, np.float64)
    known = np.diag(of) > 0.0
    scale = np.sqrt(np.diag(of)[known])
    inflation = float(np.trace(np.linalg.pinv(of[np.ix_(known, known)] / np.outer(scale, scale), hermitian=True)))
    # A last place is a tenth of its standard error at most; what rounding adds is uniform within it.
    moved = math.sqrt(max(inflation, 0.0) / 12.0) / 10.0 ** (DIGITS - 1)
    return max(0, math.ceil(math.log10(moved / _SHIFT))) if moved > 0.0 else 0


def _printed(number: Decimal, plain: bool) -> str:
    """All digits of a number, with or without a power of ten."""
    if plain:
        return f"{number:f}"
    return "0" if not number else f"{number:.{number.adjusted() - _place(number)}e}"


def _signed(text: str, sign: bool) -> str:
    return f"+{text}" if sign and not text.startswith("-") else text


def rounded_factor(factor: float) -> str:
    """A coverage factor with two decimals, such as "2.00"."""
    return str(shortest(factor).quantize(_unit(-2), ROUND_HALF_UP, _EXACT))


def rounded_df(df: float) -> str:
    """Effective degrees of freedom, cut to a whole number (JCGM 100, G.4.1); "∞" from 1000 on."""
    if df >= 1000.0:
        return "∞"
    if abs(df - round(df)) < 1e-6 * df:  # 60 that was computed as 59.99999999 is not 59
        df = float(round(df))
    return str(shortest(df).quantize(Decimal(1), ROUND_DOWN, _EXACT))


def shortest(number: float) -> Decimal:
    """The decimal number with the fewest digits that stands for a float.

    Raises:
        FitError: it is not finite.

    """
    if not math.isfinite(number):
        raise FitError(f"{number} cannot be rounded: it is not a finite number")
    return Decimal(repr(float(number)))


def _unit(place: int) -> Decimal:
    return Decimal((0, (1,), place))


def _place(number: Decimal) -> int:
    exponent = number.as_tuple().exponent
    assert isinstance(exponent, int)
    return exponent


def _digits(number: Decimal, power: int) -> str:
    return f"{number.scaleb(-power, _EXACT):f}"
