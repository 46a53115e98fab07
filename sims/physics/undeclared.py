"""Undeclared effects, each in terms of its physical cause.

Every class is one `[effects.NAME]` table of a world file; all of them are off by default. An effect of the sensors is
given once for all of them or by sensor: `uV_per_degC = 40` or `uV_per_degC = { x = 40, z = -15 }`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import pi, radians, sin

from rig.sims.physics.fields import BySensor, NumberBySensor, Several, Word, accepts, quantity
from rig.sims.physics.rotations import Vector, apply, pitch_matrix, roll_matrix
from rig.sims.physics.undeclared_pressure import PressureEffects

ARCSEC = 1.0 / 3600.0
"""One arc second in degrees."""

_BY_SENSOR = accepts(NumberBySensor(transducers=False))


@dataclass(frozen=True)
class IsolationPad:
    """Pads under the sensors deflect: the package tilts about y under its weight along x, about x under its weight
    along y.

    The tilt increases the present tilt. Tilting by c times g_x about y turns a part -c g_x g_z of the weight into the x
    axis. That is (c/2) sin(2 pitch) cos(roll): two periods of pitch, one of roll, as in NASA/TP-1999-209835.
    """

    pitch_compliance_deg_per_g: float = quantity(0.0, -1.0, 1.0)
    roll_compliance_deg_per_g: float = quantity(0.0, -1.0, 1.0)

    def deflect(self, gravity: Vector) -> Vector:
        """Gravity in the axes of the deflected sensors, given gravity in package axes."""
        tip = radians(self.pitch_compliance_deg_per_g) * gravity[0]
        lean = -radians(self.roll_compliance_deg_per_g) * gravity[1]
        if tip:
            gravity = apply(pitch_matrix(tip), gravity)
        return apply(roll_matrix(lean), gravity) if lean else gravity


@dataclass(frozen=True)
class OffsetTemperature:
    """A sensor's offset depends on the package's temperature."""

    uV_per_degC: BySensor = field(default=0.0, metadata=_BY_SENSOR)
    reference_degC: float = quantity(23.0, -100.0, 200.0)


@dataclass(frozen=True)
class SensitivityTemperature:
    """A sensor's sensitivity depends on the package's temperature."""

    ppm_per_degC: BySensor = field(default=0.0, metadata=_BY_SENSOR)
    reference_degC: float = quantity(23.0, -100.0, 200.0)


@dataclass(frozen=True)
class OffsetDrift:
    """A sensor's offset drifts with time, counted from the start of the world."""

    uV_per_h: BySensor = field(default=0.0, metadata=_BY_SENSOR)


@dataclass(frozen=True)
class SensitivityDrift:
    """A sensor's sensitivity drifts with time, counted from the start of the world."""

    ppm_per_h: BySensor = field(default=0.0, metadata=_BY_SENSOR)


@dataclass(frozen=True)
class SecondOrder:
    """An accelerometer's output has a term in the square of the acceleration along its axis."""

    ug_per_g2: BySensor = field(default=0.0, metadata=_BY_SENSOR)


@dataclass(frozen=True)
class ThirdOrder:
    """An accelerometer's output has a term in the cube of the acceleration along its axis."""

    ug_per_g3: BySensor = field(default=0.0, metadata=_BY_SENSOR)


@dataclass(frozen=True)
class Backlash:
    """Play between encoder and table, which the encoder cannot see: the table trails by half of it."""

    pitch_arcsec: float = quantity(0.0, 0.0, 3600.0)
    roll_arcsec: float = quantity(0.0, 0.0, 3600.0)

    def play_deg(self, axis: str) -> float:
        """Full width of the play of an axis, degrees."""
        return {"pitch": self.pitch_arcsec, "roll": self.roll_arcsec}.get(axis, 0.0) * ARCSEC


@dataclass(frozen=True)
class HeadError:
    """One harmonic of the head's error: the table is ahead of the encoder by amplitude * sin(periods * angle + phase).

    One period per turn is an eccentric encoder disc, two an elliptic one.
    """

    axis: str = field(default="pitch", metadata=accepts(Word(("pitch", "roll"))))
    amplitude_arcsec: float = quantity(0.0, -3600.0, 3600.0)
    periods_per_turn: float = quantity(1.0, 0.0, 1e5)
    phase_deg: float = quantity(0.0, -360.0, 360.0)

    def error_deg(self, encoder_deg: float) -> float:
        """Table minus encoder, degrees."""
        angle = (self.periods_per_turn * encoder_deg + self.phase_deg) * (pi / 180.0)
        return self.amplitude_arcsec * ARCSEC * sin(angle)


@dataclass(frozen=True)
class AttitudeEffects:
    """The possible `[effects]` of an attitude bench."""

    isolation_pad: IsolationPad = field(default_factory=IsolationPad)
    offset_temperature: OffsetTemperature = field(default_factory=OffsetTemperature)
    sensitivity_temperature: SensitivityTemperature = field(default_factory=SensitivityTemperature)
    offset_drift: OffsetDrift = field(default_factory=OffsetDrift)
    sensitivity_drift: SensitivityDrift = field(default_factory=SensitivityDrift)
    second_order: SecondOrder = field(default_factory=SecondOrder)
    third_order: ThirdOrder = field(default_factory=ThirdOrder)
    backlash: Backlash = field(default_factory=Backlash)
    head_error: tuple[HeadError, ...] = field(default=(), metadata=accepts(Several(HeadError)))


@dataclass(frozen=True)
class Effects(PressureEffects, AttitudeEffects):
    """The `[effects]` of a world. Missing ones have neutral values."""


def of_sensor(values: float | Mapping[str, float], sensor: str) -> float:
    """The value for one sensor; 0 for sensors that are not named."""
    return values.get(sensor, 0.0) if isinstance(values, Mapping) else values
