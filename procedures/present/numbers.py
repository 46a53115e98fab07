"""Parameters and coefficients as text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isnan
from typing import Any

from rig.fitter.rounding import with_error


def with_interval(row: Mapping[str, Any]) -> tuple[str, str, str]:
    """A row of `parameter_table` as text: estimate, standard error, and the 95 % interval to the same decimal place."""
    return *with_error(row["estimate"], row["stderr"]), interval_text(row["interval95"], row["stderr"])


def interval_text(ends: Sequence[float | None] | None, error: float | None) -> str:
    """An interval to the last place of the standard error of what is in it; a dash if there is none."""
    if ends is None or None in ends:
        return "-"
    low, high = (with_error(end, error)[0] for end in ends)
    return f"{low} to {high}"


def number(value: float | None, digits: int = 3) -> str:
    """A number, or a dash if there is none."""
    return "-" if value is None or isnan(value) else f"{value:.{digits}g}"
