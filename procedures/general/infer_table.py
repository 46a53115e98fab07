"""The variable of a fitted curve from its response, for calibrations of any table."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.errors import FitError
from rig.procedures.column_names import stem_of
from rig.procedures.errors import DataError
from rig.procedures.evaluate.inference import INFERRED, Inference, empty_rows, free_name, no_column, unused_beside
from rig.procedures.general.infer import CurveCalibration, InferredCurve, infer_curve
from rig.procedures.general.infer.frames import BEYOND
from rig.procedures.tables.table import Reader, Table
from rig.procedures.tables.unused import Unused


def infer_general(
    calibration: CurveCalibration,
    data: Reader,
    u_reading: float | None = None,
    quantity: str | None = None,
    between: tuple[float, float] | None = None,
) -> Inference:
    """Infer a variable of a calibration's curve from every row of a CSV table.

    Args:
        calibration: with a curve that is monotonic in the variable over the calibrated range, or over `between`.
        data: the table, with a column for the response, and for every other variable of the formula.
        u_reading: standard uncertainty of one reading, in place of the calibration's.
        quantity: the variable; None for the only one, or the only one that is no column of the table.
        between: the range in which the variable is known to be, of a curve that turns; None for all of it.

    Raises:
        DataError: the curve cannot be inverted, or a column is missing.
    """
    response = calibration.response
    notes = calibration.notes
    if u_reading is not None:
        if not 0.0 <= u_reading < np.inf:
            raise DataError(f"--u-reading {u_reading:g}: it has to be a number at or above zero")
        calibration = calibration.with_reading(u_reading)
        notes = (*notes, f"the standard uncertainty of a reading is {u_reading:g}, as given by --u-reading")
    table = data([response])
    if response not in table.columns:
        raise no_column(table, response)
    variable = _variable(calibration, table, quantity)
    others = [name for name in calibration.formula.names if name != variable]
    if between is not None:
        calibration = calibration.within(between)
        low, high = calibration.ranges[variable]
        notes = (
            *notes,
            f"{variable} is taken to be from {between[0]:g} to {between[1]:g}, as stated by --between; it was "
            f"calibrated from {low:g} to {high:g}, and a reading does not tell whether it is outside",
        )
    inputs = {name: table.columns[name] for name in (response, *others)}
    if others:
        notes = (*notes, f"{' and '.join(others)} of each row {'is' if len(others) == 1 else 'are'} taken as exact")
    flag = empty_rows(inputs)
    complete = flag == ""
    found = _inferred(calibration, inputs[response][complete], {name: inputs[name][complete] for name in others})
    name = free_name(variable, table)
    flag[complete] = found.flag
    added: dict[str, Any] = {}
    for end, values in (("", found.value), ("_sd", found.sd), ("_lo95", found.lo95), ("_hi95", found.hi95)):
        added[name + end] = np.full(len(table), np.nan)
        added[name + end][complete] = values
    added[free_name("flag", table)] = flag
    df = np.full(len(table), np.nan)
    df[complete] = found.df
    return Inference(
        {**table.columns, **table.text, **added},
        tuple(added),
        notes,
        int(np.sum(flag != "")),
        quantities=(name,),
        unused=unused_beside(table, [*inputs], inputs),
        df={name: df},
        outputs={name: (response,)},
        stated=frozenset() if calibration.reading is None else frozenset([name]),
    )


def infer_sensors(
    calibrations: Mapping[str, CurveCalibration],
    data: Reader,
    u_reading: float | None = None,
    quantity: str | None = None,
    between: tuple[float, float] | None = None,
) -> Inference:
    """Infer the variable of the curve of every calibrated output in a table, each by itself.

    Args:
        calibrations: by output.
        data: the table, with a column for one or more of the outputs.
        u_reading: standard uncertainty of one reading, in place of those of the calibrations.
        quantity: the variable to infer, for calibrations with several; others have only their own.
        between: the range in which it is known to be; None for all that was calibrated.

    Returns:
        With one output as for a calibration of one sensor. With several, columns begin with the sensor's name:
        `prt_1_bath_degC` from `prt_1_V`. Sensors of one variable are `alike`.

    Raises:
        DataError: none of the columns is there, the table has an output without the other quantities that its curve
            needs, or no curve can be inverted.
    """
    table = data(())
    present = [name for name in calibrations if name in table.columns]
    if not present:
        raise DataError(
            f"{table.source} has no output of a calibrated sensor; these are calibrated: {', '.join(calibrations)}"
        )
    found, refused = {}, {}
    for name in present:
        own = quantity if quantity in calibrations[name].formula.names else None
        try:
            found[name] = infer_general(calibrations[name], data, u_reading, own, between)
        except DataError as error:
            refused[name] = error
    if not found:
        raise next(iter(refused.values()))
    for name, why in refused.items():
        if sum(one not in table.columns for one in calibrations[name].formula.names) > 1:  # so the table lacks a column
            raise DataError(f"{why}. To infer by {', '.join(found)} alone, leave the column {name} out of the table")
    told = tuple(f"{name} was not used: {why}" for name, why in refused.items())
    if len(found) == 1:
        ((_, only),) = found.items()
        return replace(only, notes=(*only.notes, *told))
    columns: dict[str, Any] = {**table.columns, **table.text}
    quantities, flagged = [], np.zeros(len(table), np.bool_)
    alike: dict[str, dict[str, str]] = {}
    flags: dict[str, str] = {}
    for output, one in found.items():
        stem, (variable,) = stem_of(output), one.quantities
        named = f"{stem}_{variable.removeprefix(INFERRED)}"
        flag = one.added[-1]
        flags[named] = f"{stem}_{flag}"
        columns |= {f"{named}{name.removeprefix(variable)}": one.columns[name] for name in one.added if name != flag}
        columns[flags[named]] = one.columns[flag]
        quantities.append(named)
        alike.setdefault(variable.removeprefix(INFERRED), {})[named] = stem
        flagged |= np.asarray(one.columns[flag]) != ""
    added = tuple(name for name in columns if name not in table.columns and name not in table.text)
    notes = tuple(dict.fromkeys(f"{name}: {note}" for name, one in found.items() for note in one.notes))
    df = {name: one.df[one.quantities[0]] for name, one in zip(quantities, found.values(), strict=True)}
    outputs = {name: one.outputs[one.quantities[0]] for name, one in zip(quantities, found.values(), strict=True)}
    stated = frozenset(q for q, one in zip(quantities, found.values(), strict=True) if one.stated)
    several = {name: sensors for name, sensors in alike.items() if len(sensors) > 1}
    spare = {name: why for name, why in next(iter(found.values())).unused.columns.items() if name not in calibrations}
    spare = {name: why for name, why in spare.items() if all(name in one.unused.columns for one in found.values())}
    lacking = tuple(dict.fromkeys(row for one in found.values() for row in one.unused.rows))
    unused = Unused(spare, lacking)
    return Inference(
        columns,
        added,
        (*notes, *told),
        int(flagged.sum()),
        tuple(quantities),
        unused,
        df=df,
        alike=several,
        flags=flags,
        outputs=outputs,
        stated=stated,
    )


def _variable(calibration: CurveCalibration, table: Table, quantity: str | None) -> str:
    """The variable to infer. Raises `DataError` if it is not clear, or values of others are missing."""
    names, response = calibration.formula.names, calibration.response
    if calibration.formula.has_categories or not names:
        has = ", ".join(names) or "no column"
        raise DataError(f"this calibration of {response} cannot be inverted: its formula has {has}")
    if quantity is not None and quantity not in names:
        raise DataError(f"--quantity {quantity}: the calibration of {response} has {', '.join(names)}")
    unknown = [name for name in names if name not in table.columns]
    if quantity is None and len(names) > 1 and not unknown:
        raise DataError(
            f"{table.source} has columns of all variables of the calibration of {response}, {', '.join(names)}: say "
            f"with --quantity which is to be inferred"
        )
    if quantity is None and len(unknown) > 1:
        raise DataError(
            f"{table.source} has none of the columns {', '.join(unknown)}: one reading of {response} determines one "
            "variable, and the values of the others have to be in the table"
        )
    variable = quantity or (names[0] if len(names) == 1 else unknown[0])
    if missing := [name for name in unknown if name != variable]:
        raise DataError(
            f"{table.source} has no column {' and '.join(missing)}: one reading of {response} determines one variable, "
            f"here {variable}, and the values of the others have to be in the table"
        )
    return variable


def _inferred(calibration: CurveCalibration, y: FloatArray, others: Mapping[str, FloatArray]) -> InferredCurve:
    """The variable of (n,) readings with known values (n,) of the other variables; flags where these are not usable."""
    try:
        found = infer_curve(calibration.at(others), y)
    except FitError as error:
        raise DataError(f"this calibration of {calibration.response} cannot be inverted: {error}") from error
    flag = found.flag
    for name, values in reversed([*others.items()]):
        low, high = calibration.ranges[name]
        room = BEYOND * (high - low)
        words = f"{name} is outside the calibrated {low:g} to {high:g}"
        for i in np.flatnonzero((values < low - room) | (values > high + room)):
            flag[i] = f"{words}; {flag[i]}" if flag[i] else words
    return found
