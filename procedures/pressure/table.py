"""Conversion of a table to the data of a whole-plot calibration."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from rig.fitter.errors import FitError
from rig.procedures.column_names import came_from
from rig.procedures.errors import DataError
from rig.procedures.pressure.data import WholePlotData
from rig.procedures.tables.table import Table
from rig.procedures.tables.table_checks import check_units, integers, order_of
from rig.procedures.tables.unused import Unused, unused_in_fit

WHOLE_PLOT = (
    "whole_plot",
    "order",
    "elapsed_s",
    "pressure_psia",
    "sensor_temperature_degC",
    "sse_temperature_degC",
)
"""Columns of every whole-plot table, in addition to one `NAME_mV` for each transducer."""


_LOWEST = {"pressure_psia": -0.1, "sensor_temperature_degC": -273.15, "sse_temperature_degC": -273.15}
"""Minimum of an absolute reading, with a margin for the noise of a gauge at zero."""


_OPTIONAL = ("replicate", "block")


_SETTINGS = {
    "pressure_set_psia": "pressure_set_psia",
    "sensor_temperature_set_degC": "sensor_set_degC",
    "sse_temperature_set_degC": "sse_set_degC",
}
"""The fitter's names of columns of setpoints."""

FROM = came_from("pressure_psia")
"""The pressure from which a row's was set: known of the first of a whole plot by this column alone."""
SIDE = "pressure_side"
"""The side from which a row's pressure was approached, as a run records it: +1 from below, -1 from above."""
KNOWN = (*WHOLE_PLOT, *_OPTIONAL, *_SETTINGS, FROM, SIDE)
"""Used columns, in addition to the outputs in `UNIT`."""
UNIT = "mV"


def unused(table: Table) -> Unused:
    """Columns of a table that fits and traces do not use."""
    return unused_in_fit(table, KNOWN, UNIT)


def whole_plot_data(table: Table) -> WholePlotData:
    """A table as whole-plot data. Raises `DataError` with missing columns or wrong units."""
    check_units(table)
    missing = [name for name in WHOLE_PLOT if name not in table.columns]
    if missing:
        raise DataError(
            f"{table.source}: column {missing[0]} is missing; a whole-plot table has {','.join(WHOLE_PLOT)} and one "
            f"NAME_mV for each transducer"
        )
    outputs = {name: values for name, values in table.columns.items() if name.endswith("_mV")}
    if not outputs:
        volts = [name for name in table.columns if name.endswith("_V")]
        hint = f"; {volts[0]} is in volts: convert it and name it {volts[0][:-1]}mV" if volts else ""
        raise DataError(f"{table.source}: there is no transducer output; name the columns NAME_mV{hint}")
    for name, least in _LOWEST.items():
        below = np.flatnonzero(table.columns[name] < least)
        if below.size:
            row, value = int(below[0]), table.columns[name][below[0]]
            raise DataError(
                f"{table.source}, row {table.row(row)}, column {name}: {value:g} is wrong; correct or remove the row"
            )
    whole_plot, order = (integers(table, name) for name in ("whole_plot", "order"))
    order = order_of(table, order, ("replicate", "whole_plot"))
    given: dict[str, Any] = {n: integers(table, n) for n in _OPTIONAL if n in table.columns}
    given |= {ours: table.columns[name] for name, ours in _SETTINGS.items() if name in table.columns}
    try:
        data = WholePlotData(
            whole_plot=whole_plot,
            order=order,
            elapsed_s=table.columns["elapsed_s"],
            pressure_psia=table.columns["pressure_psia"],
            sensor_temperature_degC=table.columns["sensor_temperature_degC"],
            sse_temperature_degC=table.columns["sse_temperature_degC"],
            outputs=outputs,
            **given,
        )
        if FROM in table.columns:
            unknown = np.isnan(data.previous_pressure_psia)
            before = np.where(unknown, table.columns[FROM], data.previous_pressure_psia)
            data = replace(data, previous_pressure_psia=before)
        if SIDE in table.columns:  # a run approaches a repeated pressure from above, and knows the side of the first
            recorded = np.sign(table.columns[SIDE]).astype(np.int64)
            data = replace(data, pressure_side=np.where(recorded != 0, recorded, data.pressure_side))
        return data
    except FitError as error:
        raise DataError(f"{table.source}: {error}") from error


def usable(table: Table) -> tuple[WholePlotData, dict[str, str]]:
    """The data of usable transducers, and the defects of the others."""
    data = whole_plot_data(table)
    dead = {n: f"reads {v[0]:g} mV throughout" for n, v in data.outputs.items() if float(np.ptp(v)) == 0.0}
    outputs = {name: values for name, values in data.outputs.items() if name not in dead}
    if not outputs:
        raise DataError(f"{table.source}: {'; '.join(f'{n} {why}' for n, why in dead.items())}: nothing to calibrate")
    return (replace(data, outputs=outputs) if dead else data), dead
