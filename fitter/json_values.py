"""Types of JSON values."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from typing import SupportsFloat

from rig.fitter.arrays import FloatArray

JsonValue = float | int | str | None | list["JsonValue"] | dict[str, "JsonValue"]


def if_finite(value: SupportsFloat) -> float | None:
    """A number; None for NaN and infinity, which JSON has not."""
    number = float(value)
    return number if isfinite(number) else None


def coefficient_table(
    names: Sequence[str], estimates: FloatArray, stderr: FloatArray, df: FloatArray
) -> dict[str, dict[str, float | None]]:
    """Estimate, standard error and degrees of freedom by name; None for missing ones."""
    return {
        name: {"estimate": float(b), "stderr": if_finite(s), "df": if_finite(d)}
        for name, b, s, d in zip(names, estimates, stderr, df, strict=True)
    }
