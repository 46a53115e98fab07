"""A finished calibration compared with the acceptance limits of its procedure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Verdict:
    """One sensor compared with its limit.

    Attributes:
        sensor: name of its output.
        found: the value, and the limit.
        limit: the limit alone, in words.
        inside: whether the value is inside the limit.
    """

    sensor: str
    found: str
    limit: str
    inside: bool


def gross_words(found: Mapping[str, Any]) -> str:
    """Words for gross errors among the rows, after a value; "" without any."""
    rows = ", ".join(str(row) for row in found["rows"])
    return f"; with gross errors in it, row{'s' * (len(found['rows']) > 1)} {rows}: see rig fit" if rows else ""
