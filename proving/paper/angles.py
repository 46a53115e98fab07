"""Angles inferred from the simulated outputs, with their intervals: figures 23 to 33, 38, 43, 45, 46, 48, 49 and 51."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from proving.paper.table_2 import Measured
from rig.fitter.arrays import FloatArray
from rig.procedures.attitude.data import AttitudeData
from rig.procedures.attitude.fit import AttitudeFit
from rig.procedures.attitude.infer import AttitudeCalibration, InferredAttitude, infer_attitude

_CERTAIN = 1e-6
"""Noise of a reading over that of the calibration where the interval of the calibration alone is wanted."""


@dataclass(frozen=True, eq=False)
class Package:
    """The sensors of some rows of Table 2, calibrated, with what they were calibrated from.

    Attributes:
        data: the observations.
        fits: one or three.
        calibration: of them.

    """

    data: AttitudeData
    fits: tuple[AttitudeFit, ...]
    calibration: AttitudeCalibration

    @staticmethod
    def of(measured: Measured, *figures: str) -> Package:
        """That of these rows, all of one night."""
        fits = tuple(measured.fit(figure) for figure in figures)
        return Package(measured.data(figures[0]), fits, AttitudeCalibration.from_fits(fits))

    def errors(self) -> tuple[FloatArray, FloatArray]:
        """(n,) pitch and (n,) roll inferred from the outputs less the angles set, deg; NaN where undetermined."""
        outputs = np.column_stack([self.data.outputs[fit.sensor] for fit in self.fits])
        found = self._infer(outputs, self.data.pitch_deg, self.data.roll_deg, 1.0)
        return _wrapped(found.pitch_deg - self.data.pitch_deg), _wrapped(found.roll_deg - self.data.roll_deg)

    def half_widths(
        self, pitch_deg: FloatArray, roll_deg: FloatArray, *, of_roll: bool
    ) -> tuple[FloatArray, FloatArray]:
        """(m,) half-widths of the 95 % intervals at these attitudes: of the calibration alone, and of one reading.

        In deg; NaN where the angle is undetermined.
        """
        outputs = np.column_stack([fit.predict(pitch_deg, roll_deg) for fit in self.fits])
        found = [self._infer(outputs, pitch_deg, roll_deg, noise) for noise in (_CERTAIN, 1.0)]
        alone, reading = (_half(f.roll_lo95_deg, f.roll_deg, f.roll_hi95_deg) if of_roll else
                          _half(f.pitch_lo95_deg, f.pitch_deg, f.pitch_hi95_deg) for f in found)  # fmt: skip
        return np.where(np.isfinite(reading), alone, np.nan), reading

    def _infer(
        self, outputs: FloatArray, pitch_deg: FloatArray, roll_deg: FloatArray, noise: float
    ) -> InferredAttitude:
        """Of outputs at known attitudes; roll counts as measured without error where there is one sensor."""
        measured = roll_deg if len(self.fits) == 1 and self.calibration.roll else None
        return infer_attitude(
            self.calibration,
            outputs,
            roll_deg=measured,
            near_deg=(pitch_deg, roll_deg),
            noise_sd_V=noise * self.calibration.sigma_V,
        )


def _half(low: FloatArray, value: FloatArray, high: FloatArray) -> FloatArray:
    """The longer side: an interval of pitch ends at +-90 deg."""
    return np.where(np.isfinite(value), np.maximum(high - value, value - low), np.nan)


def _wrapped(angle_deg: FloatArray) -> FloatArray:
    return np.mod(angle_deg + 180.0, 360.0) - 180.0
