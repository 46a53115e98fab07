"""Pitch and roll from the outputs of a package of attitude sensors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rig.fitter.errors import FitError
from rig.procedures.attitude.infer import AttitudeCalibration, InferredAttitude, infer_attitude
from rig.procedures.errors import DataError
from rig.procedures.evaluate.inference import Inference, empty_rows, free_name, no_column, unused_beside
from rig.procedures.tables.table import Reader, Table

_TEMPERATURE = "sensor_temperature_degC"


def infer_attitudes(
    calibration: AttitudeCalibration,
    data: Reader,
    *,
    measured_roll: str | None,
    roll_sd_deg: float,
    near_deg: tuple[float, float] | None,
    sensors: Sequence[str] | None,
) -> Inference:
    """Infer pitch, and roll if it was not measured, from every row of a CSV table.

    Args:
        calibration: of the package.
        data: the table, with a column for every sensor.
        measured_roll: column of independently measured roll, in degrees; None to infer it.
        roll_sd_deg: its standard deviation.
        near_deg: pitch and roll near the package's attitude; level if None.
        sensors: the used sensors; all of the calibration if None.

    Raises:
        DataError: a column is missing, or the sensors do not determine the requested angles.
    """
    if roll_sd_deg and measured_roll is None:
        raise DataError("--roll-sd is of a roll that was measured: name its column with --roll")
    try:
        calibration = calibration if sensors is None else calibration.only(sensors)
    except FitError as error:
        raise DataError(f"--sensors: {error}") from error
    needed = [*calibration.names, *([measured_roll] if measured_roll else [])]
    needed += [_TEMPERATURE] if calibration.needs_temperature else []
    table = data(needed)
    _check_columns(table, needed, calibration)
    inputs = {name: table.columns[name] for name in needed}
    flag = empty_rows(inputs)
    complete = flag == ""
    if not complete.any():
        raise DataError(f"{table.source}: in every row a value is missing; in row {table.row(0)}: {flag[0]}")
    try:
        answer = infer_attitude(
            calibration,
            np.column_stack([table.columns[name][complete] for name in calibration.names]),
            roll_deg=None if measured_roll is None else table.columns[measured_roll][complete],
            roll_sd_deg=roll_sd_deg,
            near_deg=near_deg,
            sensor_temperature_degC=table.columns[_TEMPERATURE][complete] if _TEMPERATURE in needed else None,
        )
    except FitError as error:
        hint = "; name its column: --roll roll_deg" if len(calibration.sensors) == 1 else ""
        hint = ": --near PITCH ROLL" if "near which attitude" in str(error) else hint
        raise DataError(f"{table.source}: {error}{hint}") from error
    found = _in_all_rows(answer, complete)
    found.flag[~complete] = flag[~complete]
    added = _columns(
        table, "pitch_deg", found.pitch_deg, found.pitch_sd_deg, found.pitch_lo95_deg, found.pitch_hi95_deg
    )
    if measured_roll is None and calibration.roll:
        angles = (found.roll_deg, found.roll_sd_deg, found.roll_lo95_deg, found.roll_hi95_deg)
        added |= _columns(table, "roll_deg", *angles)
    if found.assumed.any():
        added[free_name("assumed", table)] = found.assumed * 1
    added[free_name("flag", table)] = found.flag
    notes = list(calibration.notes)
    if found.assumed.any():
        side = (
            "level (--near says otherwise)" if near_deg is None else f"pitch {near_deg[0]:g}, roll {near_deg[1]:g} deg"
        )
        notes.append(
            f"{int(found.assumed.sum())} of {len(found.assumed)} rows fit another attitude as well, which intervals "
            f"leave out: given is the one on the side of {side}; column assumed"
        )
    if measured_roll is not None and roll_sd_deg == 0:
        notes.append("the measured roll is taken as exact: --roll-sd gives its standard deviation")
    quantities = [name.removesuffix("_sd") for name in added if name.endswith("_sd")]
    return Inference(
        {**table.columns, **table.text, **added},
        tuple(added),
        tuple(notes),
        int(np.sum(found.flag != "")),
        quantities=tuple(quantities),
        df=dict(zip(quantities, (found.df, found.roll_df), strict=False)),
        turns=dict.fromkeys(quantities, 360.0),
        outputs=dict.fromkeys(quantities, calibration.names),
        unused=unused_beside(table, needed, inputs),
    )


def _check_columns(table: Table, needed: Sequence[str], calibration: AttitudeCalibration) -> None:
    """Raise `DataError` if a column is missing, with the next step."""
    for name in needed:
        if name in table.columns:
            continue
        fewer = name in calibration.names and len(calibration.names) > 1
        hint = f"; to infer from fewer sensors name them: --sensors {calibration.names[0]},..."
        raise no_column(table, name, hint if fewer else "")


def _in_all_rows(answer: InferredAttitude, complete: NDArray[np.bool_]) -> InferredAttitude:
    """Attitudes of the complete rows among all rows: NaN, False and "" in the others."""
    spread = {}
    for each in fields(answer):
        values = getattr(answer, each.name)
        empty: Any = {"f": np.nan, "b": False}.get(values.dtype.kind, "")
        spread[each.name] = np.full(len(complete), empty, values.dtype)
        spread[each.name][complete] = values
    return InferredAttitude(**spread)


def _columns(table: Table, name: str, value: Any, sd: Any, low: Any, high: Any) -> dict[str, Any]:
    """Columns of one quantity."""
    name = free_name(name, table)
    return {name: value, f"{name}_sd": np.where(np.isfinite(sd), sd, np.nan), f"{name}_lo95": low, f"{name}_hi95": high}
