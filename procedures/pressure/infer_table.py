"""Pressure from a transducer's output and both temperatures, corrected by the zero read in vacuum."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rig.fitter.arrays import FloatArray
from rig.fitter.errors import FitError
from rig.procedures.errors import DataError
from rig.procedures.evaluate.inference import Inference, empty_results, empty_rows, free_name, incomplete_rows
from rig.procedures.pressure.fit import PressureCalibration
from rig.procedures.pressure.infer import Zero, infer_pressure
from rig.procedures.pressure.zeros import (
    PRESSURE,
    PRESSURE_SD,
    TEMPERATURES,
    VACUUM,
    WHOLE_PLOT,
    ZeroRows,
    Zeros,
    read_zeros,
    zero_rows,
)
from rig.procedures.tables.table import Reader, Table
from rig.procedures.tables.unused import Unused, other_unit, why_unused

_NUMBERS = (*TEMPERATURES, VACUUM)


def infer_pressures(
    calibrations: Mapping[str, PressureCalibration],
    data: Reader,
    zero: Reader | None,
    meaning: ZeroRows | None = None,
) -> Inference:
    """Infer pressure from every calibrated output in a CSV table.

    Args:
        calibrations: by output column.
        data: the table; a column `vacuum` marks rows read near zero pressure.
        zero: a separate table of such readings; None for those of `data`, or for none.
        meaning: meaning of several rows read near zero pressure.

    Raises:
        DataError: a column is missing, or the zero cannot be used.
    """
    table = data([*calibrations, *_NUMBERS])
    outputs = _outputs(calibrations, table, data)
    of_zero = None if zero is None else zero([*calibrations, *_NUMBERS, PRESSURE, PRESSURE_SD])
    columns: dict[str, Any] = {**table.columns, **table.text}
    given, flags = set(columns), np.zeros(len(table), bool)
    quantities, notes, without = [], [], []
    df: dict[str, FloatArray] = {}
    flag_of: dict[str, str] = {}
    zeros: dict[str, Any] = {}
    gaps: dict[str, list[tuple[int, str]]] = {}
    for output in outputs:
        found = _of_output(output, calibrations[output], table, of_zero, meaning)
        alone = len(outputs) == 1
        name = "pressure_psia" if alone else f"{output.removesuffix('_mV')}_pressure_psia"
        name = free_name(name, table)
        flag = "flag" if alone and "flag" not in given else f"{name}_flag"
        columns |= {f"{name}{end}": values for end, values in found.values.items()} | {flag: found.flag}
        df[name], flag_of[name] = found.df, flag
        flags |= found.flag != ""
        quantities.append(name)
        notes += [*(f"{output}: {note}" for note in calibrations[output].notes), *found.notes]
        for source, lacking in found.incomplete.items():
            gaps[source] = [*gaps.get(source, []), *(each for each in lacking if each not in gaps.get(source, []))]
        zeros |= {output: found.zeros} if found.zeros else {}
        if found.without:
            without.append(output if found.without == len(table) else f"{output} ({found.without} rows)")
    if meaning is not None and not zeros:
        raise DataError("--zero-rows says what rows read in vacuum are, and there are none: give --zero, or mark them")
    if without:
        notes.append(f"{', '.join(without)}: no zero was read in vacuum, so the whole-plot error is in the interval")
    marked = zero_rows(table)
    if of_zero is not None and marked is not None and marked.any():
        notes.append(f"the rows of {table.source} that are marked {VACUUM} are not taken as zeros: --zero was given")
    notes += [
        f"{name} is calibrated, but {table.source} has no such column" for name in calibrations if name not in outputs
    ]
    return Inference(
        columns,
        tuple(name for name in columns if name not in given),
        tuple(notes),
        int(flags.sum()),
        quantities=tuple(quantities),
        unused=_unused(calibrations, table, of_zero, gaps),
        zeros=zeros,
        df=df,
        flags=flag_of,
        outputs={name: (output,) for name, output in zip(quantities, outputs, strict=True)},
    )


def _outputs(calibrations: Mapping[str, PressureCalibration], table: Table, data: Reader) -> list[str]:
    """Calibrated outputs in the table. Raises `DataError` if there is none, or a temperature is missing."""
    for name in TEMPERATURES:
        if name not in table.columns:
            like = next((n for n in table.names if other_unit(n, [name])), None)
            hint = f"; {like} is in another unit: convert it and name it {name}" if like else ""
            raise DataError(f"{table.source}: there is no column {name!r}; it has {', '.join(table.names)}{hint}")
    outputs = [name for name in calibrations if name in table.columns]
    if not outputs:
        hints = [f"; {n}: {why_unused(n, calibrations)}" for n in table.names if other_unit(n, calibrations)]
        known = ", ".join(calibrations)
        raise DataError(
            f"{table.source}: it has none of the calibrated outputs ({known}); name the columns as in calibration"
            f"{''.join(hints)}"
        )
    return outputs


@dataclass(frozen=True, eq=False)
class _Found:
    """Pressures of one output; `without` counts rows that no zero corrects."""

    values: dict[str, Any]
    flag: NDArray[Any]
    notes: list[str]
    zeros: list[dict[str, Any]]
    without: int
    df: FloatArray
    incomplete: dict[str, list[tuple[int, str]]] = field(default_factory=dict)


def _of_output(
    output: str, calibration: PressureCalibration, table: Table, of_zero: Table | None, meaning: ZeroRows | None
) -> _Found:
    values: dict[str, Any] = {end: np.full(len(table), np.nan) for end in ("", "_sd", "_lo95", "_hi95")}
    inputs = {name: table.columns[name] for name in (output, *TEMPERATURES)}
    flag = empty_rows(inputs)
    complete, without, df = flag == "", 0, np.full(len(table), np.nan)
    notes: list[str] = []
    zeros: list[dict[str, Any]] = []
    incomplete = {table.source: incomplete_rows(table, inputs)}
    for rows, read in _parts(output, calibration, table, of_zero, meaning):
        source = table if of_zero is None else of_zero
        here = rows & complete
        try:
            output_mV, sensor, sse = (v[here] for v in inputs.values())
            found = infer_pressure(calibration, output_mV, sensor, sse, _in_flight(read))
        except FitError as error:
            raise DataError(f"{source.source}: {output}: {error}") from error
        quantities = found.pressure_psia, found.sd_psia, found.lo95_psia, found.hi95_psia
        for end, quantity in zip(values, quantities, strict=True):
            values[end][here] = quantity
        flag[here], df[here] = found.flag, found.df
        if read is None:
            without += int(rows.sum())
            continue
        notes += read.sentences(output, found.departures)
        zeros.append(read.to_json(source.source, found.departures))
        lacking = [(row, name) for row, name in read.incomplete if (row, name) not in incomplete.get(source.source, ())]
        incomplete.setdefault(source.source, []).extend(lacking)
    return _Found(values, flag, notes, zeros, without, df, incomplete)


def _in_flight(read: Zeros | None) -> Zero | Sequence[Zero] | None:
    """Whether it is one zero of the readings' own whole plot; several are not."""
    return None if read is None else read.zeros[0] if len(read.zeros) == 1 else read.zeros


def _parts(
    output: str, calibration: PressureCalibration, table: Table, of_zero: Table | None, meaning: ZeroRows | None
) -> list[tuple[NDArray[np.bool_], Zeros | None]]:
    """Rows of the table corrected by one zero, and that zero: by whole plot if the table has them."""
    everywhere = np.ones(len(table), bool)
    if of_zero is not None:
        marked = zero_rows(of_zero)
        rows = np.ones(len(of_zero), bool) if marked is None else marked
        return [(everywhere, read_zeros(output, calibration, of_zero, rows, meaning))]
    marked = zero_rows(table)
    if marked is None or not marked.any():
        return [(everywhere, None)]
    plots = table.columns.get(WHOLE_PLOT)
    if plots is None or not np.isfinite(plots).all():
        return [(everywhere, read_zeros(output, calibration, table, marked, meaning))]
    found: list[tuple[NDArray[np.bool_], Zeros | None]] = []
    for plot in np.unique(plots):
        rows = plots == plot
        here = rows & marked
        found.append((rows, read_zeros(output, calibration, table, here, meaning) if here.any() else None))
    return found


def _unused(
    calibrations: Mapping[str, PressureCalibration],
    table: Table,
    of_zero: Table | None,
    gaps: Mapping[str, list[tuple[int, str]]],
) -> Unused:
    marked = zero_rows(table)
    used = {*calibrations, *_NUMBERS, "simulated"}
    in_zero = {PRESSURE, PRESSURE_SD, WHOLE_PLOT}
    here = used if of_zero is not None or marked is None or not marked.any() else used | in_zero
    found = {name: why_unused(name, calibrations) for name in table.names if name not in here}
    rows = empty_results(gaps.get(table.source, ()))
    if of_zero is None:
        return Unused(found, rows)
    for name in of_zero.names:
        if name not in used | in_zero and name not in found:
            found[f"{of_zero.source}: {name}"] = why_unused(name, calibrations)
    marked = zero_rows(of_zero)
    if marked is not None:
        rows += [(of_zero.row(int(i)), "", f"of {of_zero.source}: not in vacuum") for i in np.flatnonzero(~marked)]
    rows += [
        (row, name, f"no value in {of_zero.source}: left out of the zero") for row, name in gaps.get(of_zero.source, ())
    ]
    return Unused(found, rows)
