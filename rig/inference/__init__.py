"""Calibrations in use: quantities inferred from outputs, with standard deviations and 95 % intervals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from procedures.attitude.infer.calibration import AttitudeCalibration
from procedures.attitude.infer_table import infer_attitudes
from procedures.general.infer.curve import CurveCalibration
from procedures.general.infer_table import infer_general
from procedures.inference import Inference
from procedures.pressure.infer_table import infer_pressures
from procedures.pressure.zeros import ZeroRows
from rig.errors import UsageError
from rig.inference.calibration_file import CalibrationFile, read_calibration

__all__ = ["CalibrationFile", "Inference", "ZeroRows", "infer", "read_calibration"]


def infer(
    file: CalibrationFile,
    data: Path,
    *,
    zero: Path | None = None,
    zero_rows: ZeroRows | None = None,
    measured_roll: str | None = None,
    roll_sd_deg: float = 0.0,
    near_deg: tuple[float, float] | None = None,
    sensors: Sequence[str] | None = None,
) -> Inference:
    """Infer what a calibration is of from a CSV table.

    Args:
        file: the calibration.
        data: the table.
        zero: pressure: a table of readings near vacuum; None to take those of `data`, or to do without.
        zero_rows: pressure: what several such readings are of.
        measured_roll: attitude: column of roll measured otherwise; None to infer it.
        roll_sd_deg: attitude: its standard deviation.
        near_deg: attitude: pitch and roll on the side where the package is; level if None.
        sensors: attitude: those to infer from; all of the calibration if None.

    Raises:
        UsageError: an option does not go with the calibration, a column is missing, or a value cannot be used.

    """
    of_pressure = {"--zero": zero, "--zero-rows": zero_rows}
    of_attitude = {"--roll": measured_roll, "--near": near_deg, "--sensors": sensors}
    if isinstance(file.calibration, AttitudeCalibration):
        _refuse(of_pressure, "is for pressure transducers; this calibration is of attitude sensors")
        found = infer_attitudes(
            file.calibration,
            data,
            measured_roll=measured_roll,
            roll_sd_deg=roll_sd_deg,
            near_deg=near_deg,
            sensors=sensors,
        )
    elif isinstance(file.calibration, CurveCalibration):
        what = f"this calibration is of {file.calibration.response}, a column of a table"
        _refuse(of_pressure, f"is for pressure transducers; {what}")
        _refuse(of_attitude, f"is for attitude sensors; {what}")
        found = infer_general(file.calibration, data)
    else:
        _refuse(of_attitude, "is for attitude sensors; this calibration is of pressure transducers")
        found = infer_pressures(file.calibration, data, zero, zero_rows)
    if file.incomplete:
        found = replace(found, notes=(f"the calibration is of an incomplete run: {file.incomplete}", *found.notes))
    found = replace(found, notes=(*file.confirmed, *found.notes))
    if file.simulated and "simulated" not in found.columns:
        rows = len(next(iter(found.columns.values())))
        found = replace(found, columns={**found.columns, "simulated": np.ones(rows)})
    return found


def _refuse(options: Mapping[str, object], why: str) -> None:
    """Raise `UsageError` for an option that was given and does not go with the calibration."""
    for option, given in options.items():
        if given is not None:
            raise UsageError(f"{option} {why}")
