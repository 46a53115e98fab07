"""Undeclared effects of pressure transducers and their line, each in terms of its physical cause.

As in `rig.sims.physics.undeclared`, every class is one `[effects.NAME]` table of a world file. Effects of a transducer
are given once for all of them or by name. Temperatures are relative to each transducer's own references.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import exp

from rig.sims.physics.fields import BySensor, NumberBySensor, accepts, quantity

_BY_SENSOR = accepts(NumberBySensor(transducers=True))


@dataclass(frozen=True)
class ThirdOrderPressure:
    """The output has a term in the cube of the pressure."""

    uV_per_psi3: BySensor = field(default=0.0, metadata=_BY_SENSOR)


@dataclass(frozen=True)
class PressureSquaredTemperature:
    """The nonlinearity depends on a temperature."""

    sensor_nV_per_psi2_degC: BySensor = field(default=0.0, metadata=_BY_SENSOR)
    sse_nV_per_psi2_degC: BySensor = field(default=0.0, metadata=_BY_SENSOR)


@dataclass(frozen=True)
class PressureTemperatureSquared:
    """The sensitivity has a quadratic temperature coefficient."""

    sensor_nV_per_psi_degC2: BySensor = field(default=0.0, metadata=_BY_SENSOR)
    sse_nV_per_psi_degC2: BySensor = field(default=0.0, metadata=_BY_SENSOR)


@dataclass(frozen=True)
class ThirdOrderTemperature:
    """The offset has a cubic temperature coefficient."""

    sensor_nV_per_degC3: BySensor = field(default=0.0, metadata=_BY_SENSOR)
    sse_nV_per_degC3: BySensor = field(default=0.0, metadata=_BY_SENSOR)


@dataclass(frozen=True)
class Hysteresis:
    """The output after a downward approach is higher than after an upward approach.

    It is half the width of the loop. The width is a parabola over pressure: zero at zero pressure and at full scale.
    """

    uV: BySensor = field(default=0.0, metadata=_BY_SENSOR)
    full_scale_psi: float = quantity(5.0, 1e-3, 1e4)

    def shape(self, pressure_psia: float) -> float:
        """Width as a fraction of the maximum."""
        x = min(1.0, max(0.0, pressure_psia / self.full_scale_psi))
        return 4.0 * x * (1.0 - x)


@dataclass(frozen=True)
class CarryOver:
    """The diaphragm creeps: a fraction of every step of pressure is delayed and decays with time."""

    pct: BySensor = field(default=0.0, metadata=_BY_SENSOR)
    time_constant_s: float = quantity(60.0, 1e-3, 1e9)


@dataclass(frozen=True)
class ThermalLag:
    """After a change of the sensors' temperature the offset lags: this much per degree of the change."""

    uV_per_degC: BySensor = field(default=0.0, metadata=_BY_SENSOR)
    time_constant_s: float = quantity(7200.0, 1.0, 1e9)


@dataclass(frozen=True)
class ThermalTranspiration:
    """Bore of the line between the room and the cold transducers; without the effect the line is wide."""

    bore_mm: float = quantity(0.0, 0.0, 100.0)


@dataclass(frozen=True)
class WholeplotDrift:
    """The transducers' offsets drift with time, counted from the start of the world: whole plots differ."""

    uV_per_h: BySensor = field(default=0.0, metadata=_BY_SENSOR)


@dataclass(frozen=True)
class ExcitationDrift:
    """The bridges' excitation drifts, and with it their sensitivity, counted from the start of the world."""

    ppm_per_h: BySensor = field(default=0.0, metadata=_BY_SENSOR)


@dataclass(frozen=True)
class ExcitationTemperature:
    """The supply of all bridges depends on the electronics' temperature: it scales the whole outputs, also at zero."""

    ppm_per_sse_degC: float = quantity(0.0, -1e5, 1e5)


@dataclass(frozen=True)
class ThermalGradient:
    """While its temperature changes, one side of a transducer is warmer than the other."""

    uV_per_degC_per_h: BySensor = field(default=0.0, metadata=_BY_SENSOR)


@dataclass(frozen=True)
class OffsetJump:
    """At this time, counted from the start of the world, offsets jump without a note."""

    jump_uV: BySensor = field(default=0.0, metadata=_BY_SENSOR)
    at_h: float = quantity(12.0, 0.0, 1e5)


@dataclass(frozen=True)
class ReferenceNonlinearity:
    """The reference gauge of the controller has a cubic error: the pressure is off by this much of its cube."""

    upsi_per_psi3: float = quantity(0.0, -1e6, 1e6)


@dataclass(frozen=True)
class ColdColumn:
    """The gas in this last part of the line has the transducers' temperature, so it is denser."""

    drop_m: float = quantity(0.0, -100.0, 100.0)

    def over(self, sensor_degC: float, room_degC: float) -> float:
        """Pressure at the transducers relative to a column at room temperature."""
        per_m = 0.0280134 * 9.80665 / 8.314463  # nitrogen, K/m
        return exp(per_m * self.drop_m * (1.0 / (sensor_degC + 273.15) - 1.0 / (room_degC + 273.15)))


@dataclass(frozen=True)
class PressureEffects:
    """The possible `[effects]` of a pressure bench."""

    third_order_pressure: ThirdOrderPressure = field(default_factory=ThirdOrderPressure)
    pressure_squared_temperature: PressureSquaredTemperature = field(default_factory=PressureSquaredTemperature)
    pressure_temperature_squared: PressureTemperatureSquared = field(default_factory=PressureTemperatureSquared)
    third_order_temperature: ThirdOrderTemperature = field(default_factory=ThirdOrderTemperature)
    hysteresis: Hysteresis = field(default_factory=Hysteresis)
    carry_over: CarryOver = field(default_factory=CarryOver)
    thermal_lag: ThermalLag = field(default_factory=ThermalLag)
    thermal_transpiration: ThermalTranspiration = field(default_factory=ThermalTranspiration)
    wholeplot_drift: WholeplotDrift = field(default_factory=WholeplotDrift)
    excitation_drift: ExcitationDrift = field(default_factory=ExcitationDrift)
    excitation_temperature: ExcitationTemperature = field(default_factory=ExcitationTemperature)
    thermal_gradient: ThermalGradient = field(default_factory=ThermalGradient)
    offset_jump: OffsetJump = field(default_factory=OffsetJump)
    reference_nonlinearity: ReferenceNonlinearity = field(default_factory=ReferenceNonlinearity)
    cold_column: ColdColumn = field(default_factory=ColdColumn)
