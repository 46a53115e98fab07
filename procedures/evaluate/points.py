"""Points that a person asks for: `--at force_kN=2.5,room_degC=20`."""

from __future__ import annotations

import math
from collections.abc import Sequence

from rig.procedures.errors import DataError

WITH_EFFECTS = "--at predicts by the declared model; with effects beside it: rig budget RUN --traced --at NAME=VALUE"
"""Refusal of a prediction by a model with effects."""


def points(texts: Sequence[str]) -> list[dict[str, float]]:
    """Quantities and their values at each point. Raises `DataError`."""
    found = []
    for text in texts:
        point: dict[str, float] = {}
        for part in text.split(","):
            name, _, value = part.partition("=")
            try:
                point[name.strip()] = float(value)
            except ValueError:
                point[name.strip()] = math.nan
            if not math.isfinite(point[name.strip()]):
                raise DataError(
                    f"--at {text}: {part!r} is not a quantity and its value, such as force_kN=2.5; several are "
                    f"separated by commas"
                )
        found.append(point)
    return found
