"""Packages of figures 6 to 20: sensors of unit sensitivity, perfectly calibrated, and the errors of their angles.

Everything is asked of `rig.procedures.attitude.infer`, with which a calibrated package is inferred. Its errors are
of first order as those of the paper. Noise is made so small that no attitude is left open for being near a singular
one.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from rig.fitter.arrays import FloatArray
from rig.procedures.attitude.angles import sin_cos
from rig.procedures.attitude.infer import AttitudeCalibration, InferredAttitude, SensorModel, infer_attitude
from rig.procedures.attitude.model import AXES, COLUMNS, linear_coefficients

NOISE = 1e-8
"""Standard deviation of the x sensor, in g."""

Mounting = tuple[str, float, float, float]
"""Axis, coning angle in deg, azimuth in deg, noise in that of the x sensor."""


def package(*sensors: Mounting, roll: bool = True) -> AttitudeCalibration:
    """A package whose calibration is known exactly.

    Args:
        sensors: axis, coning and azimuth (deg) and relative noise of each.
        roll: whether it was calibrated with roll.

    """
    models = tuple(
        SensorModel(axis, axis, linear_coefficients(AXES[axis], 0.0, 1.0, coning, azimuth), NOISE * noise, 1e9)
        for axis, coning, azimuth, noise in sensors
    )
    size = len(COLUMNS) * len(models)
    every = (-180.0, 180.0)
    return AttitudeCalibration(models, np.zeros((size, size)), every, every, roll=roll)


def found(
    calibration: AttitudeCalibration,
    pitch_deg: ArrayLike,
    roll_deg: ArrayLike,
    *,
    measured_roll_sd: float | None = None,
    weighted: bool = True,
) -> InferredAttitude:
    """What is inferred from noise-free outputs; attitudes are broadcast and laid out in one row.

    Args:
        calibration: of the package.
        pitch_deg: true pitch; with `roll_deg` of one shape.
        roll_deg: true roll.
        measured_roll_sd: where roll is measured: its standard deviation in rad, over that of the x sensor in g.
        weighted: as in `infer_attitude`.

    """
    pitch, roll = (a.ravel() for a in np.broadcast_arrays(np.asarray(pitch_deg, float), np.asarray(roll_deg, float)))
    (sin_a, cos_a), (sin_r, cos_r) = sin_cos(pitch), sin_cos(roll)
    outputs = (calibration.matrix @ np.stack([sin_a, -sin_r * cos_a, -cos_r * cos_a])).T
    near = (pitch, roll)
    if measured_roll_sd is not None:
        sd = float(np.degrees(measured_roll_sd * NOISE))
        return infer_attitude(
            calibration, outputs, roll_deg=roll, roll_sd_deg=sd, near_deg=near, noise_sd_V=calibration.sigma_V
        )
    return infer_attitude(calibration, outputs, near_deg=near, noise_sd_V=calibration.sigma_V, weighted=weighted)


def normalised_sd(
    calibration: AttitudeCalibration,
    pitch_deg: ArrayLike,
    roll_deg: ArrayLike,
    *,
    measured_roll_sd: float | None = None,
    weighted: bool = True,
) -> tuple[FloatArray, FloatArray]:
    """Standard deviations of pitch over that of the x sensor, and of roll over that of the second sensor (figure 10).

    In rad per g of noise, of the shape of the attitudes; infinite where an angle is undetermined.
    """
    shape = np.broadcast_shapes(np.shape(pitch_deg), np.shape(roll_deg))
    out = found(calibration, pitch_deg, roll_deg, measured_roll_sd=measured_roll_sd, weighted=weighted)
    second = calibration.sensors[min(1, len(calibration.sensors) - 1)].sigma_V
    of_pitch, of_roll = np.radians(out.pitch_sd_deg) / NOISE, np.radians(out.roll_sd_deg) / second
    return of_pitch.reshape(shape), of_roll.reshape(shape)


def percent(values: FloatArray, than: ArrayLike) -> FloatArray:
    """How much larger, in percent."""
    return np.asarray(100.0 * (values / np.asarray(than) - 1.0))


def off_grid(low: float, high: float, step: float) -> FloatArray:
    """Angles half-way between the multiples of `step`, so that none is one where a package is singular."""
    return np.arange(low + step / 2, high, step)


def worst(values: Sequence[float] | FloatArray) -> float:
    """The largest."""
    return float(np.max(values))
