"""Calibrations in use: quantities inferred from outputs, with standard deviations and 95 % intervals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from fitter.inverse import AttitudeCalibration
from rig.errors import UsageError
from rig.inference.attitude import infer_attitudes
from rig.inference.calibration_file import CalibrationFile, Inference, read_calibration
from rig.inference.pressure import infer_pressures
from rig.inference.zeros import ZeroRows

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
    if isinstance(file.calibration, AttitudeCalibration):
        for option, given in (("--zero", zero), ("--zero-rows", zero_rows)):
            if given is not None:
                raise UsageError(f"{option} is for pressure transducers; this calibration is of attitude sensors")
        found = infer_attitudes(
            file.calibration,
            data,
            measured_roll=measured_roll,
            roll_sd_deg=roll_sd_deg,
            near_deg=near_deg,
            sensors=sensors,
        )
    else:
        if measured_roll is not None or near_deg is not None or sensors is not None:
            raise UsageError(
                "--roll, --near and --sensors are for attitude sensors; this calibration is of pressure transducers"
            )
        found = infer_pressures(file.calibration, data, zero, zero_rows)
    if file.incomplete:
        found = replace(found, notes=(f"the calibration is of an incomplete run: {file.incomplete}", *found.notes))
    if file.simulated and "simulated" not in found.columns:
        rows = len(next(iter(found.columns.values())))
        found = replace(found, columns={**found.columns, "simulated": np.ones(rows)})
    return found
