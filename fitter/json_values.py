"""What JSON can hold."""

from __future__ import annotations

from math import isfinite
from typing import SupportsFloat

JsonValue = float | int | str | None | list["JsonValue"] | dict[str, "JsonValue"]


def if_finite(value: SupportsFloat) -> float | None:
    """A number; None for NaN and infinity, which JSON has not."""
    number = float(value)
    return number if isfinite(number) else None
