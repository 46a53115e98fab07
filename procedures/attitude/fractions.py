"""Information in a part of a measured run: NASA/TP-1999-209835, sections 9.2.2, 9.3.3 and 9.3.4.

A full pitch-roll calibration contains every fraction of its grid. A fit of such a part gives the result of a run with
fewer points. The whole run's residuals under the part's coefficients (figures 36, 52 and 54) show its errors.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.errors import FitError
from rig.procedures.attitude.data import AttitudeData, settings
from rig.procedures.attitude.fit import AttitudeFit, fit_attitude

Cell = tuple[int, int]
NAN = float("nan")
_MESH = 61
"""Number of angles in each direction for the search of the widest interval; the variance function is smooth
over 6 deg.
"""

FAMILY, TUMBLE = "fraction", "tumble"


@dataclass(frozen=True, eq=False)
class MeasuredGrid:
    """The full grid of settings of a calibration, found from its angles.

    Attributes:
        pitch_deg: (N,) rows, ascending.
        roll_deg: (M,) columns, ascending; +180 and -180 deg are two, as commanded.
        row: (n,) row of each observation.
        column: (n,) column of each observation.
        visits: (N, M) number of visits of one replication to each cell: two for a pass up and back.
        replications: number of replications.
    """

    pitch_deg: FloatArray
    roll_deg: FloatArray
    row: IntArray
    column: IntArray
    visits: IntArray
    replications: int

    @classmethod
    def of(cls, data: AttitudeData) -> MeasuredGrid:
        """Find the grid.

        Raises:
            FitError: a combination of pitch and roll is missing in all replications.
        """
        row, column = settings(data.pitch_deg), settings(data.roll_deg)
        shape = (int(row.max()) + 1, int(column.max()) + 1)
        points = np.unique(np.column_stack([data.point, row, column]), axis=0)
        visits = np.zeros(shape, np.int64)
        np.add.at(visits, (points[:, 1], points[:, 2]), 1)
        if not visits.all():
            raise FitError(
                f"the points are no full grid: {shape[0]} pitch and {shape[1]} roll angles are {visits.size} pairs, of "
                f"which {np.count_nonzero(visits)} were measured. A run cut short is finished by `rig resume`; of a "
                f"fraction, or of points without a grid, no fraction is taken"
            )
        angles = (_typical(data.pitch_deg, row), _typical(data.roll_deg, column))
        return cls(*angles, row, column, visits, len(data.replicates))

    @property
    def points(self) -> int:
        """K, number of visits in one replication."""
        return int(self.visits.sum())

    @property
    def missing(self) -> int:
        """Number of visits missing in some replications."""
        return self.points * self.replications - len(self.row)

    def points_of(self, cells: Collection[Cell]) -> int:
        """Number of visits to these cells in one replication."""
        return int(self.visits[self._mask(cells)].sum())

    def rows_of(self, cells: Collection[Cell]) -> NDArray[np.bool_]:
        """(n,) whether each observation was made at these cells."""
        return np.asarray(self._mask(cells)[self.row, self.column])

    def _mask(self, cells: Collection[Cell]) -> NDArray[np.bool_]:
        mask = np.zeros(self.visits.shape, np.bool_)
        mask[tuple(np.array(list(cells), np.int64).T)] = True
        return mask


@dataclass(frozen=True, eq=False)
class PartFit:
    """One sensor calibrated with a part of a run, compared with the whole.

    Attributes:
        fit: of the part alone.
        points: K, points of one replication.
        observations: number of used rows.
        interval95_V: widest 95 % calibration interval, half-width, over the range of the whole run.
        residual_V: standard error of the whole run's residuals under the part's coefficients, with the degrees of
            freedom of the whole run's own fit, which has the smallest.
        coverage95: share of the whole run's readings within the part's own 95 % prediction intervals.
    """

    fit: AttitudeFit
    points: int
    observations: int
    interval95_V: float
    residual_V: float
    coverage95: float

    def shift(self, whole: AttitudeFit) -> FloatArray:
        """(k,) its coefficients minus those of the whole run's fit, in its own standard errors.

        Coefficients of a model with temperature are compared at the whole run's reference temperature.
        """
        own = self.fit
        difference = own.linear.coefficients - whole.linear.coefficients
        if own.temperature is not None and whole.temperature is not None:
            per_degC, along = own.temperature.coefficients, own.temperature.direction
            warmer = whole.temperature.reference_degC - own.temperature.reference_degC
            difference = difference + warmer * np.array([per_degC[0], *(per_degC[1] * along)])
        return np.asarray(difference / own.linear.stderr)


def fit_part(
    data: AttitudeData, sensor: str, rows: NDArray[np.bool_] | None = None, *, temperature: bool = False
) -> PartFit:
    """Calibrate a sensor with a part of a run.

    Args:
        data: the whole run.
        sensor: name of the output.
        rows: (n,) mask of the part's observations; None for all.
        temperature: whether offset and sensitivity depend on the sensor's temperature in the declared model.

    Raises:
        rig.fitter.linear.RankError: the part does not determine the model.
        FitError: the output never changes, or there is no temperature to fit.
    """
    part = data if rows is None else data.take(np.flatnonzero(rows))
    if part.has_roll != data.has_roll:
        raise FitError("the part has no roll, the whole run has: their models are not the same")
    fit = fit_attitude(part, sensor, temperature=temperature)
    columns = fit.columns(data.pitch_deg, data.roll_deg)
    residual = data.outputs[sensor] - fit.linear.predict(columns)
    if fit.temperature is not None:
        residual = residual - fit.temperature.volts(columns, data)
    mesh = (np.linspace(low, high, _MESH) for low, high in _range(data))
    pitch, roll = (angle.ravel() for angle in np.meshgrid(*mesh))
    free = len(data) - (len(part) - fit.linear.df)
    return PartFit(
        fit=fit,
        points=fit.replication.n_points,
        observations=len(part),
        interval95_V=float(np.max(fit.linear.confidence(fit.columns(pitch, roll)))),
        residual_V=float(np.sqrt(np.sum(residual**2) / free)) if free > 0 else NAN,
        coverage95=float(np.mean(np.abs(residual) <= fit.linear.prediction(columns))) if fit.linear.df > 0 else NAN,
    )


def _range(data: AttitudeData) -> list[tuple[Any, Any]]:
    return [(angle.min(), angle.max()) for angle in (data.pitch_deg, data.roll_deg)]


def _typical(angle_deg: FloatArray, setting: IntArray) -> FloatArray:
    """(m,) mean angle of each setting, without the rounding errors of a mean."""
    return np.round(np.bincount(setting, angle_deg) / np.bincount(setting), 9)
