"""Predictors for residuals if there is no previous calibration: the columns of the declared model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.procedures.column_names import stem_of
from rig.procedures.kinds import kinds
from rig.watch.reading import ShownObservation


def columns_of(seen: Sequence[ShownObservation]) -> dict[str, FloatArray]:
    """(n,) values of every quantity that was set or read, by name; NaN where it was not."""
    names = {name for s in seen for group in (s.setpoints, s.references, s.temperatures) for name in group}
    return {
        name: np.array([np.nan if (value := s.mean(name)) is None else value for s in seen], np.float64)
        for name in names
    }


def model_columns(
    seen: Sequence[ShownObservation], kind: str, declared: Mapping[str, Any], sensors: Sequence[str]
) -> dict[str, FloatArray | None]:
    """(n, k) columns of a kind's declared model of each sensor at these observations, by its column.

    None if it has none, or is unknown. Sensors with the same model have the same array.
    """
    known = kinds().get(kind)
    if known is None:
        return dict.fromkeys(sensors)
    columns = columns_of(seen)
    models = {name: known.declared_of(declared, stem_of(name)) for name in sensors}
    made = {id(model): known.model_columns(columns, model) for model in models.values()}
    return {name: made[id(model)] for name, model in models.items()}
