"""Pressure from a transducer's output and both temperatures, the zero read in vacuum taken out."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from fitter.pressure import STOOD_DEGC, PressureCalibration, Zero, infer_pressure
from rig.errors import UsageError
from rig.inference.calibration_file import Inference
from rig.tables import Table, read_any_csv

_TEMPERATURES = ("sensor_temperature_degC", "sse_temperature_degC")
VACUUM = "vacuum"
"""Column that is 1 where a row was read in vacuum, and 0 elsewhere."""


def infer_pressures(calibrations: Mapping[str, PressureCalibration], data: Path, zero: Path | None) -> Inference:
    """Infer pressure from every calibrated output in a CSV table.

    Args:
        calibrations: by output column.
        data: the table; a column `vacuum` marks rows read at zero pressure.
        zero: a table of readings in vacuum instead; None to take those of `data`, or to do without.

    Raises:
        UsageError: a column is missing, or the zero cannot be used.

    """
    for path in (p for p in (data, zero) if p is not None):
        if not path.is_file():
            raise UsageError(f"there is no file {path}")
    table = read_any_csv(data, _TEMPERATURES)
    text = [name for name in calibrations if name in table.text]
    if text:
        raise UsageError(f"{data}, column {text[0]}: not all of its values are numbers")
    outputs = [name for name in calibrations if name in table.columns]
    if not outputs:
        known = ", ".join(calibrations)
        raise UsageError(f"{data}: it has none of the calibrated outputs ({known}); name the columns as in calibration")
    for name in _TEMPERATURES:
        if name not in table.columns:
            raise UsageError(f"{data}, column {name}: not all of its values are numbers")
    columns: dict[str, Any] = {**table.columns, **table.text}
    given, flags = set(columns), np.zeros(len(table), bool)
    without: list[str] = []
    notes: tuple[str, ...] = ()
    for output in outputs:
        found_zero = _zero(output, table if zero is None else read_any_csv(zero, [output, *_TEMPERATURES]), zero)
        try:
            sensor, sse = (table.columns[name] for name in _TEMPERATURES)
            found = infer_pressure(calibrations[output], table.columns[output], sensor, sse, found_zero)
        except ValueError as error:
            raise UsageError(f"{zero or data}: {output}: {error}") from error
        alone = len(outputs) == 1
        name = "pressure_psia" if alone else f"{output.removesuffix('_mV')}_pressure_psia"
        name = f"inferred_{name}" if name in given else name
        columns |= {
            name: found.pressure_psia,
            f"{name}_sd": found.sd_psia,
            f"{name}_lo95": found.lo95_psia,
            f"{name}_hi95": found.hi95_psia,
            "flag" if alone and "flag" not in given else f"{name}_flag": found.flag,
        }
        flags |= found.flag != ""
        if found_zero is None:
            without.append(output)
    if without:
        notes = (f"{', '.join(without)}: no zero was read in vacuum, so the whole-plot error is in the interval",)
    return Inference(columns, tuple(name for name in columns if name not in given), notes, int(flags.sum()))


def _zero(output: str, table: Table, path: Path | None) -> Zero | None:
    """The mean of the readings in vacuum; None where there are none. One stay in vacuum is one zero."""
    if path is None:
        if VACUUM in table.text or (VACUUM in table.columns and not np.isin(table.columns[VACUUM], (0, 1)).all()):
            raise UsageError(f"{table.source}, column {VACUUM}: it is 1 for rows read in vacuum and 0 for the others")
        if VACUUM not in table.columns:
            return None
        rows = table.columns[VACUUM] == 1
    else:
        rows = np.ones(len(table), bool)
    if not rows.any():
        return None
    for name in (output, *_TEMPERATURES):
        if name not in table.columns:
            raise UsageError(f"{table.source}, column {name}: not all of its values are numbers")
    for name in _TEMPERATURES:
        spread = float(np.ptp(table.columns[name][rows]))
        if spread > STOOD_DEGC:
            raise UsageError(
                f"{table.source}: {name} varies by {spread:.3g} degC over the readings in vacuum; a zero is of one "
                f"stay at one temperature: give one at a time"
            )
    reading, sensor, sse = (float(table.columns[name][rows].mean()) for name in (output, *_TEMPERATURES))
    return Zero(reading, sensor, sse)
