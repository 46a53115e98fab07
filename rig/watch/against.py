"""Predictors for residuals if there is no previous calibration: the columns of the declared model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from fitter.arrays import FloatArray
from procedures.kind import kinds
from rig.watch.reading import Seen


def columns_of(seen: Sequence[Seen]) -> dict[str, FloatArray]:
    """(n,) values of every quantity that was set or read, by name; NaN where it was not."""
    names = {name for s in seen for group in (s.setpoints, s.references, s.temperatures) for name in group}
    return {
        name: np.array([np.nan if (value := s.mean(name)) is None else value for s in seen], np.float64)
        for name in names
    }


def model_columns(seen: Sequence[Seen], kind: str, declared: Mapping[str, Any]) -> FloatArray | None:
    """(n, k) columns of a kind's declared model at these observations; None if it has none, or is unknown."""
    known = kinds().get(kind)
    return None if known is None else known.model_columns(columns_of(seen), declared)
