"""A previous calibration: what it expects a run to read, and how far off it may be."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy import special

from fitter.arrays import FloatArray
from fitter.errors import FitError
from procedures.attitude.infer.calibration import AttitudeCalibration
from procedures.attitude.model import attitude_columns, mounting_matrix
from procedures.general.infer.curve import CurveCalibration
from procedures.pressure.fit.calibration import PressureCalibration
from rig.errors import UsageError
from rig.inference.calibration_file import calibration_of, read_calibration
from rig.quantities import PITCH, PRESSURE, ROLL, SENSOR, SSE
from rig.regular import read_regular_text

_TO_GRAVITY = np.array([1.0, -1.0, -1.0])

Columns = Mapping[str, FloatArray]
"""(n,) by quantity: settings, or what was read where that is known better; NaN where it was not recorded."""


@dataclass(frozen=True, eq=False)
class Expected:
    """What a calibration says of one output.

    Attributes:
        output: (n,) what it expects.
        own: (n,) standard deviation of what is new at every observation.
        shared: (n,) of what neighbouring observations have in common: the calibration's error, the whole plot's.
        df: degrees of freedom of `shared`.
        free: how many ways the shared error has to vary over a run.

    """

    output: FloatArray
    own: FloatArray
    shared: FloatArray
    df: float
    free: int

    def reach(self, chance: float) -> float:
        """Standard deviations that the shared error passes anywhere with this chance (Scheffe)."""
        return math.sqrt(self.free * float(special.fdtri(self.free, self.df, 1.0 - chance)))


@dataclass(frozen=True, eq=False)
class Previous:
    """A previous calibration.

    Attributes:
        name: of the file it came from.
        calibration: of a package of attitude sensors, or of pressure transducers by output column.

    """

    name: str
    calibration: AttitudeCalibration | Mapping[str, PressureCalibration]

    def expected(self, columns: Columns, mounting: Mapping[str, float]) -> dict[str, Expected]:
        """By output; {} for a run of another kind. `mounting` is the procedure's, how the package is turned."""
        needed = (PITCH, ROLL) if isinstance(self.calibration, AttitudeCalibration) else (PRESSURE, SENSOR, SSE)
        if any(name not in columns for name in needed):
            return {}
        if isinstance(self.calibration, AttitudeCalibration):
            return _attitude(self.calibration, columns, mounting)
        return {name: _pressure(one, columns) for name, one in self.calibration.items()}


def read_previous(path: Path) -> Previous:
    """A calibration file, or an earlier run, which is fitted now. Raises `UsageError` or `RunFileError`."""
    if path.suffix != ".sqlite":
        try:
            return Previous(path.name, _of_a_bench(read_calibration(path).calibration))
        except FitError as error:
            raise UsageError(f"{path}: {error}") from error
    return Previous(path.name, _of_a_bench(calibration_of(_fitted(path))))


def previous_text(path: Path) -> str:
    """The same as text to keep in a run file, which `parse_previous` reads. Raises as `read_previous`."""
    given = _fitted(path) if path.suffix == ".sqlite" else _content(path)
    return json.dumps({"name": path.name, "content": given}, allow_nan=False)


def parse_previous(text: str, where: str) -> Previous:
    """What `previous_text` gave. Raises `UsageError`."""
    try:
        given = json.loads(text)
        return Previous(str(given["name"]), _of_a_bench(calibration_of(given["content"])))
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise UsageError(f"{where}: the previous calibration in it cannot be read: {error}") from error


def _of_a_bench(calibration: Any) -> AttitudeCalibration | Mapping[str, PressureCalibration]:
    """A calibration that a run can be compared with. Raises `FitError` for one of a table of any kind."""
    if isinstance(calibration, CurveCalibration):
        raise FitError("it is of a table of any kind, which says nothing of what a bench's sensors should read")
    return calibration  # type: ignore[no-any-return]


def _content(path: Path) -> Any:
    read_calibration(path)  # says what is wrong with it
    return json.loads(read_regular_text(path))


def _fitted(path: Path) -> dict[str, Any]:
    from rig.closed_loop import fit_table  # noqa: PLC0415
    from rig.tables import read_table  # noqa: PLC0415

    return fit_table(read_table(path)).to_json()


def _attitude(calibration: AttitudeCalibration, columns: Columns, mounting: Mapping[str, float]) -> dict[str, Expected]:
    g = attitude_columns(columns[PITCH], columns[ROLL])[:, 1:] * _TO_GRAVITY
    turns = [float(mounting.get(f"{axis}_deg", 0.0)) for axis in "xyz"]
    if any(turns):
        g = g @ mounting_matrix(*turns).T
    warmth = np.zeros(len(g))
    if calibration.reference_degC is not None:
        warmth = columns.get(SENSOR, np.full(len(g), np.nan)) - calibration.reference_degC
    found, first = {}, 0
    for sensor, sigma in zip(calibration.sensors, calibration.sigma_V, strict=True):
        rows, k = sensor.rows(g.T, warmth), sensor.coefficients.size
        block = calibration.use_covariance[first : first + k, first : first + k]
        first += k
        shared = np.sqrt(np.maximum(np.einsum("kn,kl,ln->n", rows, block, rows), 0.0))
        df = sensor.df if calibration.drift is None else calibration.drift.df
        found[sensor.name] = Expected(sensor.coefficients @ rows, np.full(len(g), sigma), shared, df, k)
    return found


def _pressure(one: PressureCalibration, columns: Columns) -> Expected:
    variables = {"P": columns[PRESSURE], "T_sensor": columns[SENSOR], "T_SSE": columns[SSE]}
    rows = one.formula.columns(variables)[1]
    own = np.einsum("nk,kl,nl->n", rows, one.covariance, rows)
    between, spread = one.errors.between_variance, float(one.errors.spread[2, 2])
    df = 2.0 * one.errors.wholeplot_variance**2 / spread if spread > 0.0 else 1e3
    shared = np.sqrt(np.maximum(own, 0.0) + between)
    return Expected(rows @ one.coefficients, one.errors.subplot_sd(columns[PRESSURE]), shared, max(1.0, df), 1)
