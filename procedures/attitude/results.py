"""Results of a calibrated package: parameters, outputs and inferred angles, as functions of the coefficients."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.errors import FitError
from rig.procedures.attitude.infer import AttitudeCalibration, InferredAttitude, infer_attitude
from rig.procedures.attitude.model import attitude_columns, sensitive_axis
from rig.procedures.evaluate.inference import within_half_turn

STANDARD_GRAVITY = 9.80665
"""m/s2, CGPM 1901."""
PITCH, ROLL = "pitch_deg", "roll_deg"


@dataclass(frozen=True, eq=False)
class Model:
    """Evaluation from coefficients to results.

    Attributes:
        calibration: of the run, corrected.
        at_deg: (p, 2) pitch and roll at which outputs and angles are given.
        gravity: local gravity, m/s2; None if it is not known.
    """

    calibration: AttitudeCalibration
    at_deg: FloatArray
    gravity: float | None

    @property
    def angles(self) -> tuple[str, ...]:
        """Angles that the package's outputs determine."""
        alone = len(self.calibration.sensors) == 1 or not self.calibration.roll
        return ("pitch",) if alone else ("pitch", "roll")

    @cached_property
    def readings(self) -> FloatArray:
        """(p, S) outputs at these angles."""
        return self.outputs(self.calibration)

    def outputs(self, calibration: AttitudeCalibration) -> FloatArray:
        """(p, S) outputs of a calibration at these angles, at its reference temperature."""
        h = attitude_columns(self.at_deg[:, 0], self.at_deg[:, 1])
        g = np.column_stack([h[:, 1], -h[:, 2], -h[:, 3]])
        extra = [one.beyond(g.T, np.zeros(len(g))) for one in calibration.sensors]
        return np.asarray(calibration.offsets_V + g @ calibration.matrix.T + np.column_stack(extra))

    def named(self) -> Iterable[tuple[str, str, str, Mapping[str, float]]]:
        """Name, unit, sensor and settings of every result; a coefficient has none."""
        for one in self.calibration.names:
            yield f"{one} offset", "V", one, {}
            yield f"{one} sensitivity per local g", "V", one, {}
            if self.gravity is not None:
                yield f"{one} sensitivity per standard gravity", "V", one, {}
            yield from ((f"{one} {axis}", "V", one, {}) for axis in ("mx", "my", "mz"))
        where = [(f"at pitch {a:g} deg, roll {r:g} deg", {PITCH: a, ROLL: r}) for a, r in self.at_deg.tolist()]
        yield from ((f"{one} output {label}", "V", one, at) for label, at in where for one in self.calibration.names)
        yield from ((f"inferred {angle} {label}", "deg", "", at) for label, at in where for angle in self.angles)

    def values(self, coefficients: FloatArray, readings: FloatArray, gravity: float | None) -> FloatArray:
        """(m,) results.

        Args:
            coefficients: (S, 4) in the model's order.
            readings: (p, S) outputs from which angles are inferred.
            gravity: local gravity, m/s2.
        """
        found: list[float] = []
        used = with_coefficients(self.calibration, coefficients)
        for one in coefficients:
            m = sensitive_axis(one)
            S = float(np.linalg.norm(m))
            found += [float(one[0]), S]
            found += [] if gravity is None else [S * STANDARD_GRAVITY / gravity]
            found += m.tolist()
        found += self.outputs(used).ravel().tolist()
        found += self._inferred(used, readings).ravel().tolist()
        return np.array(found)

    def infer(self, used: AttitudeCalibration, readings: FloatArray) -> InferredAttitude:
        """Angles of (p, S) readings; with one sensor, roll is known. Raises `FitError`."""
        known = len(used.sensors) == 1
        return infer_attitude(
            used,
            readings,
            roll_deg=self.at_deg[:, 1] if known and used.roll else None,
            near_deg=(self.at_deg[:, 0], self.at_deg[:, 1]),
            sensor_temperature_degC=used.reference_degC,
        )

    def _inferred(self, used: AttitudeCalibration, readings: FloatArray) -> FloatArray:
        """(p, angles) angles, deg, within half a turn of `at_deg`; NaN where they are not determined."""
        try:
            answer = self.infer(used, readings)
        except FitError:
            return np.full((len(readings), len(self.angles)), np.nan)
        found = np.column_stack([answer.pitch_deg, answer.roll_deg])
        # a step over +-180 deg is none: differences of results are taken on one side of the seam
        found = self.at_deg + within_half_turn(found - self.at_deg, 360.0)
        return found[:, : len(self.angles)]


def with_coefficients(calibration: AttitudeCalibration, coefficients: FloatArray) -> AttitudeCalibration:
    """The calibration with other coefficients (S, 4) of the declared model."""
    sensors = tuple(
        replace(one, coefficients=np.concatenate([own, one.coefficients[4:]]))
        for one, own in zip(calibration.sensors, coefficients, strict=True)
    )
    return replace(calibration, sensors=sensors, drift=None, alternatives=())
