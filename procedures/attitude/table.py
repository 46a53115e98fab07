"""Conversion of a table to the data of a pitch-roll calibration."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from rig.fitter.errors import FitError
from rig.procedures.attitude.data import AttitudeData
from rig.procedures.attitude.model import mounting_matrix
from rig.procedures.column_names import came_from
from rig.procedures.errors import DataError
from rig.procedures.tables.table import Table
from rig.procedures.tables.table_checks import check_units, integers, order_of
from rig.procedures.tables.unused import Unused, unused_in_fit

PITCH_ROLL = ("replicate", "order", "elapsed_s", "pitch_deg", "roll_deg", "sensor_temperature_degC")
"""Columns of every pitch-roll table, in addition to one `NAME_V` for each sensor."""


MOUNTING = ("mounting_x_deg", "mounting_y_deg", "mounting_z_deg")
"""Columns of a pitch-roll table of a turned package: about x, then y, then z."""


_OPTIONAL = ("pitch_side", "roll_side", "block")
FROM = (came_from("pitch_deg"), came_from("roll_deg"))
KNOWN = (*PITCH_ROLL, *_OPTIONAL, *MOUNTING, *FROM)
"""Used columns, in addition to the outputs in `UNIT`."""
UNIT = "V"


def unused(table: Table) -> Unused:
    """Columns of a table that fits and traces do not use."""
    return unused_in_fit(table, KNOWN, UNIT)


def attitude_data(table: Table) -> AttitudeData:
    """A table as pitch-roll data. Raises `DataError` with missing columns or wrong units."""
    check_units(table)
    optional = {"sensor_temperature_degC"} if "run_id" in table.provenance else set()
    missing = [name for name in PITCH_ROLL if name not in table.columns and name not in optional]
    if missing:
        raise DataError(
            f"{table.source}: column {missing[0]} is missing; a pitch-roll table has {','.join(PITCH_ROLL)} and one "
            f"NAME_V for each sensor"
        )
    outputs = {name: values for name, values in table.columns.items() if name.endswith("_V")}
    if not outputs:
        raise DataError(f"{table.source}: there is no sensor output; name the columns x_V, y_V, z_V")
    numbers = {name: integers(table, name) for name in ("replicate", "order")}
    numbers |= {name: integers(table, name) for name in _OPTIONAL if name in table.columns}
    order = order_of(table, numbers["order"], ("replicate",))
    known: dict[str, Any] = {name: numbers[name] for name in _OPTIONAL if name in numbers}
    known["axes"] = {name: axis for name, axis in table.axes.items() if name in outputs} or None
    try:
        data = AttitudeData(
            replicate=numbers["replicate"],
            order=order,
            elapsed_s=table.columns["elapsed_s"],
            pitch_deg=table.columns["pitch_deg"],
            roll_deg=table.columns["roll_deg"],
            sensor_temperature_degC=table.columns.get("sensor_temperature_degC"),
            outputs=outputs,
            mounting=_mounting(table),
            **known,
        )
        return replace(data, **_before_the_first(table, data))
    except FitError as error:
        raise DataError(f"{table.source}: {error}") from error


def _before_the_first(table: Table, data: AttitudeData) -> dict[str, Any]:
    """Previous angles whose first one is that from which the head came to the first point, where that is known."""
    found: dict[str, Any] = {}
    first = int(np.argmin(data.order))
    for column in (one for one in FROM if one in table.columns and np.isfinite(table.columns[one][first])):
        angles = np.array(getattr(data, name := f"previous_{column.replace('_from', '')}"))
        angles[first] = table.columns[column][first]
        found[name] = angles
    return found


def _mounting(table: Table) -> np.ndarray[Any, np.dtype[np.float64]] | None:
    """(n, 3, 3) rotation of the package from its usual mounting; None without a rotation."""
    for name in table.columns:
        if name.lower().startswith("mounting") and name not in MOUNTING:
            raise DataError(f"{table.source}: column {name} is no mounting; the three are {', '.join(MOUNTING)}")
    turns = np.column_stack([table.columns.get(name, np.zeros(len(table))) for name in MOUNTING])
    if not turns.any():
        return None
    if np.abs(turns).max() > 360.0:
        raise DataError(f"{table.source}: a package turned by {np.abs(turns).max():g} deg? mounting is in degrees")
    kinds, which = np.unique(turns, axis=0, return_inverse=True)
    return np.stack([mounting_matrix(*kind) for kind in kinds.tolist()])[np.ravel(which)]
