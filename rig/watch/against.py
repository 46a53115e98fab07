"""What residuals are residuals of: a previous calibration, or the declared model fitted to what is there so far."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fitter.arrays import FloatArray
from fitter.attitude import attitude_columns, mounting_matrix
from fitter.inverse import AttitudeCalibration
from fitter.pressure import PressureCalibration
from fitter.pressure.models import named_formula
from rig.closed_loop import fit_table
from rig.inference.calibration_file import read_calibration
from rig.tables import read_table
from rig.watch.reading import Seen

PITCH, ROLL = "pitch_deg", "roll_deg"
PRESSURE, SENSOR, SSE = "pressure_psia", "sensor_temperature_degC", "sse_temperature_degC"
_TO_GRAVITY = np.array([1.0, -1.0, -1.0])


@dataclass(frozen=True, eq=False)
class Reference:
    """A previous calibration.

    Attributes:
        name: of the file it came from.
        calibration: of a package of attitude sensors, or of pressure transducers by output column.

    """

    name: str
    calibration: AttitudeCalibration | Mapping[str, PressureCalibration]

    def expected(self, seen: Sequence[Seen], mounting: Mapping[str, float]) -> dict[str, FloatArray]:
        """(n,) outputs the calibration expects at these observations, by output; NaN where it cannot say."""
        if isinstance(self.calibration, AttitudeCalibration):
            return _attitude(self.calibration, seen, mounting)
        variables = {"P": _column(seen, PRESSURE), "T_sensor": _column(seen, SENSOR), "T_SSE": _column(seen, SSE)}
        return {
            name: np.asarray(one.formula.columns(variables)[1] @ one.coefficients)
            for name, one in self.calibration.items()
        }


def read_reference(path: Path) -> Reference:
    """A calibration file, or an earlier run, which is fitted now. Raises `UsageError` or `RunFileError`."""
    if path.suffix != ".sqlite":
        return Reference(path.name, read_calibration(path).calibration)
    fitted = fit_table(read_table(path))
    if fitted["data"]["kind"] == "pitch-roll":
        return Reference(path.name, AttitudeCalibration.from_dict(fitted["calibration"]))
    sensors = {n: PressureCalibration.from_dict(s["calibration"]) for n, s in fitted["sensors"].items()}
    return Reference(path.name, sensors)


def model_columns(seen: Sequence[Seen]) -> FloatArray | None:
    """(n, k) columns of the declared model at these observations; None for a run of no kind we know a model of.

    A turned mounting changes the coefficients, not what the columns span, so residuals need not know of it.
    """
    if all(PITCH in s.setpoints for s in seen):
        return attitude_columns(_column(seen, PITCH), _column(seen, ROLL))
    if all(PRESSURE in s.setpoints for s in seen):
        variables = {"P": _column(seen, PRESSURE), "T_sensor": _column(seen, SENSOR), "T_SSE": _column(seen, SSE)}
        return named_formula("full").columns(variables)[1]
    return None


def with_temperature(columns: FloatArray, seen: Sequence[Seen]) -> FloatArray:
    """Offset and sensitivity follow the sensors' temperature: every column once more, times it."""
    degC = _column(seen, SENSOR)
    if not np.all(np.isfinite(degC)):
        return columns
    return np.column_stack([columns, columns * (degC - degC.mean())[:, None]])


def _attitude(
    calibration: AttitudeCalibration, seen: Sequence[Seen], mounting: Mapping[str, float]
) -> dict[str, FloatArray]:
    columns = attitude_columns(_column(seen, PITCH), _column(seen, ROLL))
    g = columns[:, 1:] * _TO_GRAVITY
    turns = [float(mounting.get(f"{axis}_deg", 0.0)) for axis in "xyz"]
    if any(turns):
        g = g @ mounting_matrix(*turns).T
    warmth = np.zeros(len(seen))
    if calibration.reference_degC is not None:
        warmth = _column(seen, SENSOR) - calibration.reference_degC
    return {s.name: np.asarray(s.coefficients @ s.rows(g.T, warmth)) for s in calibration.sensors}


def _column(seen: Sequence[Seen], name: str) -> FloatArray:
    return np.array([np.nan if (value := s.mean(name)) is None else value for s in seen], np.float64)
