"""Readings near zero pressure in a table: their rows, their pressure, and their settings of temperature."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from rig.procedures.column_names import split_unit
from rig.procedures.errors import DataError
from rig.procedures.pressure.fit import PressureCalibration
from rig.procedures.pressure.infer import STOOD_DEGC, Departure, Zero
from rig.procedures.tables.table import Table

TEMPERATURES = ("sensor_temperature_degC", "sse_temperature_degC")
VACUUM = "vacuum"
"""Column with 1 for rows read in vacuum, and 0 for others."""

PRESSURE, PRESSURE_SD, WHOLE_PLOT = "pressure_psia", "pressure_sd_psia", "whole_plot"
SPREAD = 0.02
"""Maximum difference of pressures of one zero, relative to the highest calibrated."""

ZeroRows = Literal["one-sitting", "independent"]
ONE_SITTING: ZeroRows = "one-sitting"
INDEPENDENT: ZeroRows = "independent"


@dataclass(frozen=True)
class Zeros:
    """The zeros of one output.

    Attributes:
        zeros: one sitting in the whole plot of the readings, or several independent ones.
        rows: number of rows of their means.
        pressure_stated: whether the table has their pressure.
        sd_stated: whether it has the standard deviation of that pressure.
        meaning: meaning of several rows; "" for one.
        incomplete: (row in the file, column) of left-out rows with a missing value.
    """

    zeros: tuple[Zero, ...]
    rows: int
    pressure_stated: bool
    sd_stated: bool
    meaning: str
    incomplete: tuple[tuple[int, str], ...]

    def to_json(self, source: str, departures: Sequence[Departure]) -> dict[str, Any]:
        """The used zeros and their deviation from the calibration."""
        return {
            "source": source,
            "rows": self.rows,
            "meaning": self.meaning or None,
            "pressure_from": PRESSURE if self.pressure_stated else "assumed",
            "zeros": [
                {
                    "bridge_mV": zero.bridge_mV,
                    "pressure_psia": zero.pressure_psia,
                    "pressure_sd_psia": zero.pressure_sd_psia if self.sd_stated else None,
                    "readings": zero.readings,
                    "off_mV": off.off_mV,
                    "expected_sd_mV": off.sd_mV,
                    "wholeplot_sd_mV": off.wholeplot_sd_mV,
                    "deviations": off.deviations,
                    "p": off.p,
                    "implausible": off.implausible,
                }
                for zero, off in zip(self.zeros, departures, strict=True)
            ],
        }

    def sentences(self, output: str, departures: Sequence[Departure]) -> list[str]:
        """Sentences about these zeros."""
        found = []
        for zero, off in zip(self.zeros, departures, strict=True):
            at = f"{zero.pressure_psia:.4g} psia"
            if not self.pressure_stated:
                at += f" (assumed: there is no column {PRESSURE})"
            elif not self.sd_stated:
                at += f" (as stated, taken as exact: there is no column {PRESSURE_SD})"
            text = f"{output}: the zero, {zero.bridge_mV:.6g} mV read at {at}, is {off.off_mV:+.3g} mV from the "
            text += f"calibration: {off.deviations:.2g} standard deviations of {off.sd_mV:.3g} mV"
            if off.implausible:
                text += (
                    f" ({abs(off.off_mV) / off.wholeplot_sd_mV:.3g} of the whole plots' alone). That is hard to "
                    f"believe: another pressure, transducer, channel or unit? every row is flagged"
                    if off.wholeplot_sd_mV > 0
                    else ". This is implausible; every row is flagged"
                )
            found.append(text)
        if self.meaning:
            found.append(f"{output}: {self.meaning}")
        return found


def zero_rows(table: Table) -> NDArray[np.bool_] | None:
    """(n,) rows marked as read in vacuum; None without such a column. Raises `DataError`."""
    if VACUUM not in table.columns:
        return None
    if not np.isin(table.columns[VACUUM], (0, 1)).all():
        raise DataError(f"{table.source}, column {VACUUM}: it is 1 for rows read in vacuum and 0 for the others")
    return np.asarray(table.columns[VACUUM] == 1)


def read_zeros(
    output: str, calibration: PressureCalibration, table: Table, rows: NDArray[np.bool_], meaning: ZeroRows | None
) -> Zeros:
    """The zeros of an output in these rows of a table.

    Args:
        output: its column.
        calibration: of the transducer.
        table: table of these readings.
        rows: (n,) mask of the rows.
        meaning: meaning of several rows; None if a column `whole_plot` gives it, or there is one row.

    Raises:
        DataError: a column is missing, the rows do not make a zero, or the meaning of several is not given.
    """
    for name in (output, *TEMPERATURES):
        if name not in table.columns:
            raise DataError(f"{table.source}: there is no column {name!r}; it has {', '.join(table.names)}")
    of_row = {name: table.columns[name] for name in (output, *TEMPERATURES)}
    incomplete = tuple(
        (table.row(int(i)), name) for name, v in of_row.items() for i in np.flatnonzero(rows & ~np.isfinite(v))
    )
    rows = rows & np.all([np.isfinite(v) for v in of_row.values()], axis=0)
    if not rows.any():
        raise DataError(f"{table.source}: no row read in vacuum has {output} and both temperatures")
    pressure, sd = _pressure(table, rows), _pressure_sd(table, rows)
    sittings, words = _sittings(table, rows, meaning)
    zeros = []
    for sitting in sittings:
        _check_one(table, sitting, pressure, calibration.ranges["P"][1])
        reading, sensor, sse = (v[sitting] for v in of_row.values())
        zeros.append(
            Zero(
                float(reading.mean()),
                float(sensor.mean()),
                float(sse.mean()),
                readings=len(reading),
                pressure_psia=0.0 if pressure is None else float(pressure[sitting].mean()),
                pressure_sd_psia=0.0 if sd is None else float(sd[sitting].max()),
                scatter_mV=float(reading.std(ddof=1)) if len(reading) > 1 else None,
            )
        )
    return Zeros(tuple(zeros), int(rows.sum()), pressure is not None, sd is not None, words, incomplete)


def _sittings(table: Table, rows: NDArray[np.bool_], meaning: ZeroRows | None) -> tuple[list[NDArray[np.intp]], str]:
    """Indices of the rows of each sitting, and their meaning in words."""
    index = np.flatnonzero(rows)
    if len(index) == 1:
        return [index], ""
    plots = table.columns.get(WHOLE_PLOT)
    if plots is not None and np.isfinite(plots[index]).all():
        values = np.unique(plots[index])
        told = f"{table.source}, column {WHOLE_PLOT}: its rows are of {len(values)} whole plot(s)"
        if meaning == INDEPENDENT and len(values) < len(index):
            raise DataError(f"{told}, so they are not all independent; leave --zero-rows {meaning} away")
        if meaning == ONE_SITTING and len(values) > 1:
            raise DataError(f"{told}, so they are not of one sitting; leave --zero-rows {meaning} away")
        sittings = [index[plots[index] == value] for value in values]
    elif meaning is None:
        raise DataError(
            f"{table.source}: {len(index)} rows were read in vacuum. Say what they are: --zero-rows {ONE_SITTING} (one "
            f"after another at the temperatures of the readings to infer, whose whole-plot error they share) or "
            f"--zero-rows {INDEPENDENT} (temperatures set again before each and before the readings to infer); or give "
            f"a column {WHOLE_PLOT}, one number for each setting of the temperatures"
        )
    else:
        sittings = [index] if meaning == ONE_SITTING else [index[i : i + 1] for i in range(len(index))]
    if len(sittings) == 1:
        return (
            sittings,
            f"{len(index)} zero rows taken as one sitting, which shares the whole-plot error of the readings",
        )
    return sittings, (
        f"{len(index)} zero rows taken as {len(sittings)} independent zeros: their mean is the zero, and a whole-plot "
        f"error of the readings' own is in the interval"
    )


def _check_one(table: Table, sitting: NDArray[np.intp], pressure: Any, highest: float) -> None:
    for name in TEMPERATURES:
        spread = float(np.ptp(table.columns[name][sitting]))
        if spread > STOOD_DEGC:
            raise DataError(
                f"{table.source}: {name} varies by {spread:.3g} degC over the readings in vacuum; a zero is of one "
                f"stay at one temperature: give one at a time, or --zero-rows {INDEPENDENT} if that is what they are"
            )
    spread = 0.0 if pressure is None else float(np.ptp(pressure[sitting]))
    if spread > SPREAD * highest:
        raise DataError(
            f"{table.source}, column {PRESSURE}: it varies by {spread:.3g} psia over one zero; leave the rows out that "
            f"were not read near zero pressure"
        )


def _pressure(table: Table, rows: NDArray[np.bool_]) -> Any:
    """(n,) pressures of the rows; None if the table does not have them."""
    for name in table.names:
        stem, unit = split_unit(name)
        if name != PRESSURE and (stem.casefold() == "pressure" or name.casefold() == "pressure"):
            raise DataError(
                f"{table.source}, column {name}: the pressure of a zero is stated in psia, absolute; convert it "
                f"{f'from {unit} ' if stem else ''}and name it {PRESSURE}"
            )
    return _complete(table, rows, PRESSURE)


def _pressure_sd(table: Table, rows: NDArray[np.bool_]) -> Any:
    sd = _complete(table, rows, PRESSURE_SD)
    if sd is not None and (sd[rows] < 0).any():
        raise DataError(f"{table.source}, column {PRESSURE_SD}: a standard deviation is not negative")
    return sd


def _complete(table: Table, rows: NDArray[np.bool_], name: str) -> Any:
    """A column, if it exists. Raises `DataError` if one of the rows has no value in it."""
    if name in table.text and any(table.text[name][rows]):
        raise DataError(f"{table.source}, column {name}: not all of its values are numbers")
    values = np.full(len(table), np.nan) if name in table.text else table.columns.get(name)  # text: blank cells only
    if values is None:
        return None
    missing = np.flatnonzero(rows & ~np.isfinite(values))
    if missing.size:
        row = table.row(int(missing[0]))
        raise DataError(f"{table.source}, row {row}, column {name}: the value is missing; fill it in")
    return values
