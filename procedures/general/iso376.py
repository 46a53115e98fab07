"""Figures of a force transducer calibrated in series of rising and falling forces (ISO 376:2011, 7.4 and 7.5).

In percent of the mean deflection at a force: repeatability, reproducibility, interpolation and reversibility. Zero
error and creep need other readings.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.errors import FitError
from rig.procedures.general.directions import are_directions, sides_of
from rig.procedures.general.infer import CurveCalibration
from rig.procedures.general.order import codes
from rig.procedures.general.series import Series
from rig.procedures.tables.table import Table


def rising(table: Table, series: Series) -> tuple[Table, str]:
    """Rows of rising series, and a sentence about the others; "" if there are none. Raises `FitError`."""
    up = _direction(table, series) > 0
    if not up.any():
        raise FitError(f"--direction: {series.direction} has no row of a rising force")
    if up.all():
        return table, ""
    where = np.flatnonzero(up)
    columns = {name: values[where] for name, values in table.columns.items()}
    text = {name: values[where] for name, values in table.text.items()}
    rows = table.numbers[where].tolist()
    count = len(up) - len(where)
    return (
        replace(table, columns=columns, text=text, rows=rows),
        f"{count} rows of falling forces are not fitted: they are in the reversibility",
    )


def _direction(table: Table, series: Series) -> FloatArray:
    every: Mapping[str, Any] = {**table.columns, **table.text}
    if series.direction not in every:
        raise FitError(f"--direction: there is no column {series.direction}")
    values = every[series.direction]
    found = np.zeros(1)
    if values.dtype.kind == "f":
        found = values
    elif are_directions(values.tolist()):
        found = sides_of(values.tolist())
    if (np.sign(found) == 0).any():
        raise FitError(f"--direction: {series.direction} has to say of every row whether the force rises or falls")
    return np.asarray(np.sign(found), np.float64)


def figures(table: Table, series: Series, calibration: CurveCalibration) -> dict[str, Any]:
    """Figures at each force, as JSON values under "iso376".

    Args:
        table: all rows.
        series: how they belong together.
        calibration: of the rising rows.

    Raises:
        FitError: a force is repeated within a series, or the curve has another column than the force.
    """
    force, y = table.columns[calibration.variable], table.columns[calibration.response]
    every: Mapping[str, Any] = {**table.columns, **table.text}
    up = _direction(table, series) > 0
    run = codes(every[series.series])
    turn = codes(every[series.position]) if series.position else np.zeros(len(y), np.int64)
    told = []
    for at in np.unique(force[up]).tolist():
        if at == 0.0:
            continue
        here = np.flatnonzero(force == at)
        rising_rows, falling = here[up[here]], here[~up[here]]
        for rows in (rising_rows, falling):
            if np.unique(run[rows]).size < rows.size:
                raise FitError(f"--series: {calibration.variable} = {at:g} is repeated within one series")
        told.append({calibration.variable: at, **_at(y, rising_rows, falling, run, turn, calibration, at)})
    return {"iso376": told}


def _at(
    y: FloatArray,
    rising_rows: IntArray,
    falling: IntArray,
    run: IntArray,
    turn: IntArray,
    calibration: CurveCalibration,
    at: float,
) -> dict[str, float | None]:
    """Figures at one force in percent; None for those that the series do not determine."""
    in_order = rising_rows[np.argsort(run[rising_rows], kind="stable")]
    of_turn = {each: in_order[turn[in_order] == each] for each in dict.fromkeys(turn[in_order].tolist())}
    first = np.array([y[rows[0]] for rows in of_turn.values()])
    twice = next((rows for rows in of_turn.values() if len(rows) > 1), None)
    mean, fitted = float(first.mean()), float(calibration.curve(np.array([at]))[0])
    back = [
        100.0 * abs(float(y[row]) - float(y[of_turn[turn[row]][-1]])) / abs(float(y[of_turn[turn[row]][-1]]))
        for row in falling
        if turn[row] in of_turn
    ]
    repeated = None if twice is None else y[twice[:2]]
    return {
        "mean": mean,
        "repeatability": None if repeated is None else 100.0 * float(np.ptp(repeated)) / abs(float(repeated.mean())),
        "reproducibility": 100.0 * float(np.ptp(first)) / abs(mean) if len(first) > 1 else None,
        "interpolation": 100.0 * (mean - fitted) / fitted,
        "reversibility": float(np.mean(back)) if back else None,
    }
