"""A finished calibration beside the limits its procedure set beforehand."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Verdict:
    """One sensor against its limit.

    Attributes:
        sensor: name of its output.
        found: what was found, and the limit it exceeds or keeps.
        limit: the limit alone, in words.
        inside: whether it is kept.

    """

    sensor: str
    found: str
    limit: str
    inside: bool


def gross_words(found: Mapping[str, Any]) -> str:
    """Which rows are gross errors, where some are; to follow a figure."""
    rows = ", ".join(str(row) for row in found["rows"])
    return f"; with gross errors in it, row{'s' * (len(found['rows']) > 1)} {rows}: see rig fit" if rows else ""
