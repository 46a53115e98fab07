"""Output of an accelerometer in the package: gravity along its sensitive axis, in volts."""

# ruff: noqa: N802  (a quantity's name ends in its unit, and units keep their own case)

from __future__ import annotations

from math import radians

from rig.sims.physics.rotations import Vector, compose, dot, pitch_matrix, roll_matrix, yaw_matrix
from rig.sims.physics.truth import SensorTruth
from rig.sims.physics.undeclared import Effects, of_sensor


def sensitive_axis(axis: str, coning_deg: float, azimuth_deg: float) -> Vector:
    """Unit vector (3,) of a sensor's sensitive axis in package axes.

    The row of the sensor's misalignment that belongs to its nominal axis: eq. (114) for x, (115) for y, (116) for z.

    Args:
        axis: "x", "y" or "z".
        coning_deg: half angle Omega of the cone about that axis.
        azimuth_deg: azimuth A on the cone.
    """
    coning, azimuth = radians(coning_deg), radians(azimuth_deg)
    if axis == "x":
        return compose(yaw_matrix(coning), roll_matrix(azimuth))[0]
    if axis == "y":
        return compose(roll_matrix(coning), pitch_matrix(azimuth))[1]
    return compose(pitch_matrix(coning), yaw_matrix(azimuth))[2]


class Accelerometer:
    """One sensor of the package.

    Args:
        name: its name on the bench, and the key of its noise.
        axis: package axis it is nominally aligned with.
        truth: its true parameters.
        effects: undeclared effects.
    """

    __slots__ = (
        "_direction", "_offset", "_offset_T", "_offset_t", "_reference_b", "_reference_s", "_second", "_sensitivity",
        "_sensitivity_T", "_sensitivity_t", "_third", "channel", "noise",
    )  # fmt: skip

    def __init__(self, name: str, axis: str, truth: SensorTruth, effects: Effects) -> None:
        self.channel = f"sensor {name}"
        self.noise = truth.noise_V
        self._direction = sensitive_axis(axis, truth.coning_deg, truth.azimuth_deg)
        self._offset = truth.offset_V
        self._sensitivity = truth.sensitivity_V_per_g
        self._second = of_sensor(effects.second_order.ug_per_g2, name) * 1e-6
        self._third = of_sensor(effects.third_order.ug_per_g3, name) * 1e-6
        self._offset_T = of_sensor(effects.offset_temperature.uV_per_degC, name) * 1e-6
        self._reference_b = effects.offset_temperature.reference_degC
        self._offset_t = of_sensor(effects.offset_drift.uV_per_h, name) * 1e-6 / 3600.0
        self._sensitivity_T = of_sensor(effects.sensitivity_temperature.ppm_per_degC, name) * 1e-6
        self._reference_s = effects.sensitivity_temperature.reference_degC
        self._sensitivity_t = of_sensor(effects.sensitivity_drift.ppm_per_h, name) * 1e-6 / 3600.0

    def output_V(self, gravity: Vector, degC: float, t: float) -> float:
        """Output without noise, volts.

        Args:
            gravity: in the axes of the package's sensors, g.
            degC: temperature of the package.
            t: virtual time.
        """
        g = dot(self._direction, gravity)
        offset = self._offset + self._offset_T * (degC - self._reference_b) + self._offset_t * t
        scale = 1.0 + self._sensitivity_T * (degC - self._reference_s) + self._sensitivity_t * t
        return offset + self._sensitivity * scale * (g + self._second * g * g + self._third * g**3)
