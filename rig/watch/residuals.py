"""Residuals so far, for a chart: from a previous calibration, or from the declared model fitted to the observations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.errors import FitError
from rig.procedures.column_names import spelled, stem_of, unit_of
from rig.procedures.kinds import kinds
from rig.procedures.plan.expected import Previous
from rig.units.of_instruments import per_volt
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


_SPARE = 6
"""Minimum number of observations beyond the model's columns, for meaningful residuals."""


def residuals(
    seen: Sequence[ShownObservation],
    reference: Previous | None,
    kind: str,
    declared: Mapping[str, Any],
    mounting: Mapping[str, float],
) -> dict[str, Any]:
    """Residuals of every sensor, and their predictor, as JSON values.

    Args:
        seen: the observations to show, in order.
        reference: a previous calibration, if any.
        kind: kind of calibration, by name.
        declared: `[model]` of the procedure.
        mounting: orientation of the package.
    """
    names = sorted({name for s in seen for name in s.outputs})
    outputs = {n: np.array([s.outputs[n][0] if n in s.outputs else np.nan for s in seen]) for n in names}
    found: dict[str, FloatArray] = {}
    if reference is not None:
        against = f"the calibration {reference.name}"
        expected = reference.expected(columns_of(seen), mounting) if seen else {}
        found = {n: y - expected[n].output for n, y in outputs.items() if n in expected}
        why = "" if found or not seen else f"{reference.name} is a calibration of other sensors"
    else:
        against = "the declared model, fitted to the points so far"
        found, why = _fitted(seen, outputs, kind, declared)
    return {
        "against": against,
        "why_none": why,
        "elapsed_s": [round(s.elapsed_s, 1) for s in seen] if found else [],
        "sensors": [_sensor(name, found[name]) for name in names if name in found],
    }


def _fitted(
    seen: Sequence[ShownObservation], outputs: Mapping[str, FloatArray], kind: str, declared: Mapping[str, Any]
) -> tuple[dict[str, FloatArray], str]:
    """Residuals by sensor, and why there are none of some."""
    if not seen:
        return {}, "nothing has been observed yet"
    try:
        every = model_columns(seen, kind, declared, tuple(outputs))
    except FitError as error:
        return {}, str(error)
    found: dict[str, FloatArray] = {}
    few: int | None = None
    for columns in {id(one): one for one in every.values() if one is not None}.values():
        usable = np.all(np.isfinite(columns), axis=1)
        scaled = columns / np.abs(columns[usable]).max(axis=0, initial=1e-300)
        rank = int(np.linalg.matrix_rank(scaled[usable])) if usable.any() else 0
        if usable.sum() < rank + _SPARE or rank < 2:
            few = int(usable.sum())
            continue
        for name in (name for name, one in every.items() if one is columns):
            y = outputs[name]
            rows = usable & np.isfinite(y)
            left = np.full(len(y), np.nan)
            if rows.sum() >= rank + _SPARE:
                coefficients = np.linalg.lstsq(scaled[rows], y[rows], rcond=1e-9)[0]
                left[rows] = y[rows] - scaled[rows] @ coefficients
                found[name] = left
    return found, "" if few is None else f"{few} points are not enough for the model yet"


def _sensor(name: str, values: FloatArray) -> dict[str, Any]:
    unit = unit_of(name)
    scale = per_volt(unit)
    scaled = values if scale is None else values * 1e6 / scale
    finite = scaled[np.isfinite(scaled)]
    rms = float(np.sqrt(np.mean(finite**2))) if finite.size else None
    return {
        "name": name,
        "unit": spelled(unit) if scale is None else "uV",
        "rms": rms,
        "values": [float(f"{v:.4g}") if np.isfinite(v) else None for v in scaled],
    }
