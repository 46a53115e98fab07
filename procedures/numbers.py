"""Parameters and coefficients as text, with decimal places by the standard error."""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite, isnan
from typing import Any

_OF_A_DOUBLE = 17


def with_error(estimate: float | None, error: float | None) -> tuple[str, str]:
    """Estimate and standard error as text: the error to two digits, the estimate to the same decimal place."""
    if estimate is None or not isfinite(estimate):
        return "-", "-"
    if error is None or not (isfinite(error) and error > 0):
        return f"{estimate:.8g}", "-"
    places = _places(error)
    return f"{estimate:.{places}f}", f"{error:.{places}f}"


def with_interval(row: Mapping[str, Any]) -> tuple[str, str, str]:
    """A row of `parameter_table` as text: estimate, standard error, and the 95 % interval to the same decimal place."""
    told = with_error(row["estimate"], row["stderr"])
    if row["interval95"] is None or None in row["interval95"]:
        return *told, "-"
    low, high = row["interval95"]
    places = _places(row["stderr"]) if row["stderr"] else 8
    return *told, f"{low:.{places}f} to {high:.{places}f}"


def _places(error: float) -> int:
    return max(0, 1 - int(f"{error:.1e}".partition("e")[2]))  # the exponent of the rounded error


def to_error(estimate: float | None, error: float | None, least: int = 8) -> tuple[str, str]:
    """Estimate and standard error as text: the error to three digits, the estimate to its last decimal place.

    Args:
        estimate: of anything; a dash if there is none.
        error: of it; a dash if there is none.
        least: digits of the estimate if the error asks for fewer. A double has 17.
    """
    digits = least
    if estimate and error and isfinite(estimate) and 0.0 < error < abs(estimate):
        first, last = (int(f"{abs(one):.2e}".partition("e")[2]) for one in (estimate, error))
        digits = min(max(least, first - last + 3), _OF_A_DOUBLE)
    return number(estimate, digits), number(error, 3)


def number(value: float | None, digits: int = 3) -> str:
    """A number, or a dash if there is none."""
    return "-" if value is None or isnan(value) else f"{value:.{digits}g}"
