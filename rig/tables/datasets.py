"""Tables as the arrays the fitter takes, checked for what only a table can have wrong."""

from __future__ import annotations

from typing import Any

import numpy as np

from fitter.errors import FitError
from procedures.attitude.data import AttitudeData
from procedures.attitude.model import mounting_matrix
from procedures.pressure.data import WholePlotData
from rig.columns import UNITS
from rig.errors import UsageError
from rig.tables.table import MOUNTING, PITCH_ROLL, WHOLE_PLOT, Table

_LARGEST = 2.0**53
_LOWEST = {"pressure_psia": -0.1, "sensor_temperature_degC": -273.15, "sse_temperature_degC": -273.15}
"""What no absolute reading goes below; a little for the noise of a gauge at zero."""

_OPTIONAL = ("pitch_side", "roll_side", "block")
_OPTIONAL_WHOLE_PLOT = ("replicate", "block")
_SETTINGS = {
    "pressure_set_psia": "pressure_set_psia",
    "sensor_temperature_set_degC": "sensor_set_degC",
    "sse_temperature_set_degC": "sse_set_degC",
}
"""Columns of setpoints to the fitter's names for them."""


def attitude_data(table: Table) -> AttitudeData:
    """A table as pitch-roll data. Raises `UsageError` naming what is missing or of another unit."""
    _check_units(table)
    optional = {"sensor_temperature_degC"} if "run_id" in table.provenance else set()
    missing = [name for name in PITCH_ROLL if name not in table.columns and name not in optional]
    if missing:
        raise UsageError(
            f"{table.source}: column {missing[0]} is missing; a pitch-roll table has {','.join(PITCH_ROLL)} and one "
            f"NAME_V for each sensor"
        )
    outputs = {name: values for name, values in table.columns.items() if name.endswith("_V")}
    if not outputs:
        raise UsageError(f"{table.source}: there is no sensor output; name the columns x_V, y_V, z_V")
    integers = {name: _integers(table, name) for name in ("replicate", "order")}
    integers |= {name: _integers(table, name) for name in _OPTIONAL if name in table.columns}
    order = integers["order"]
    _check_order(table, order)
    known: dict[str, Any] = {name: integers[name] for name in _OPTIONAL if name in integers}
    known["axes"] = {name: axis for name, axis in table.axes.items() if name in outputs} or None
    try:
        return AttitudeData(
            replicate=integers["replicate"],
            order=order,
            elapsed_s=table.columns["elapsed_s"],
            pitch_deg=table.columns["pitch_deg"],
            roll_deg=table.columns["roll_deg"],
            sensor_temperature_degC=table.columns.get("sensor_temperature_degC"),
            outputs=outputs,
            mounting=_mounting(table),
            **known,
        )
    except FitError as error:
        raise UsageError(f"{table.source}: {error}") from error


def _mounting(table: Table) -> np.ndarray[Any, np.dtype[np.float64]] | None:
    """(n, 3, 3) how the package was turned against its usual mounting; None where it was not."""
    for name in table.columns:
        if name.lower().startswith("mounting") and name not in MOUNTING:
            raise UsageError(f"{table.source}: column {name} is no mounting; the three are {', '.join(MOUNTING)}")
    turns = np.column_stack([table.columns.get(name, np.zeros(len(table))) for name in MOUNTING])
    if not turns.any():
        return None
    if np.abs(turns).max() > 360.0:
        raise UsageError(f"{table.source}: a package turned by {np.abs(turns).max():g} deg? mounting is in degrees")
    kinds, which = np.unique(turns, axis=0, return_inverse=True)
    return np.stack([mounting_matrix(*kind) for kind in kinds.tolist()])[np.ravel(which)]


def whole_plot_data(table: Table) -> WholePlotData:
    """A table as whole-plot data. Raises `UsageError` naming what is missing or of another unit."""
    _check_units(table)
    missing = [name for name in WHOLE_PLOT if name not in table.columns]
    if missing:
        raise UsageError(
            f"{table.source}: column {missing[0]} is missing; a whole-plot table has {','.join(WHOLE_PLOT)} and one "
            f"NAME_mV for each transducer"
        )
    outputs = {name: values for name, values in table.columns.items() if name.endswith("_mV")}
    if not outputs:
        volts = [name for name in table.columns if name.endswith("_V")]
        hint = f"; {volts[0]} is in volts: convert it and name it {volts[0][:-1]}mV" if volts else ""
        raise UsageError(f"{table.source}: there is no transducer output; name the columns NAME_mV{hint}")
    for name, least in _LOWEST.items():
        below = np.flatnonzero(table.columns[name] < least)
        if below.size:
            row, value = int(below[0]), table.columns[name][below[0]]
            raise UsageError(
                f"{table.source}, row {table.row(row)}, column {name}: {value:g} cannot be; mend or remove the row"
            )
    whole_plot, order = (_integers(table, name) for name in ("whole_plot", "order"))
    _check_order(table, order)
    given: dict[str, Any] = {n: _integers(table, n) for n in _OPTIONAL_WHOLE_PLOT if n in table.columns}
    given |= {ours: table.columns[name] for name, ours in _SETTINGS.items() if name in table.columns}
    try:
        return WholePlotData(
            whole_plot=whole_plot,
            order=order,
            elapsed_s=table.columns["elapsed_s"],
            pressure_psia=table.columns["pressure_psia"],
            sensor_temperature_degC=table.columns["sensor_temperature_degC"],
            sse_temperature_degC=table.columns["sse_temperature_degC"],
            outputs=outputs,
            **given,
        )
    except FitError as error:
        raise UsageError(f"{table.source}: {error}") from error


def _check_order(table: Table, order: np.ndarray[Any, np.dtype[np.int64]]) -> None:
    seen, counts = np.unique(order, return_counts=True)
    if (counts > 1).any():
        twice = int(seen[counts > 1][0])
        rows = [table.row(int(r)) for r in np.flatnonzero(order == twice)[:2]]
        raise UsageError(
            f"{table.source}, rows {rows[0]} and {rows[1]}: order {twice} stands there twice; a point copied?"
        )


def _integers(table: Table, name: str) -> np.ndarray[Any, np.dtype[np.int64]]:
    values = table.columns[name]
    if (np.abs(values) > _LARGEST).any():
        row = int(np.flatnonzero(np.abs(values) > _LARGEST)[0])
        raise UsageError(
            f"{table.source}, row {table.row(row)}, column {name}: {values[row]:g} is too large to number anything"
        )
    whole = values.astype(np.int64)
    if (whole != values).any():
        row = int(np.flatnonzero(whole != values)[0])
        raise UsageError(f"{table.source}, row {table.row(row)}, column {name}: {values[row]:g} is not a whole number")
    return whole


def _check_units(table: Table) -> None:
    for name in table.columns:
        stem, _, unit = name.rpartition("_")
        wanted = UNITS.get(stem)
        if stem in ("x", "y", "z"):
            wanted = "V"
        if wanted is not None and unit != wanted and not name.endswith("_side"):
            raise UsageError(f"{table.source}: column {name} is in {unit!r}; convert it and name it {stem}_{wanted}")
