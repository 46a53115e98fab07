"""Effects of pressure transducers and their line that nobody declared, each in the terms of its physical cause.

As in `sims.physics.undeclared`, every class is one `[effects.NAME]` table of a world file. Those of a transducer may
be given once for all of them or by name. Temperatures count from each transducer's own references.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import exp

from sims.physics.fields import BySensor, NumberBySensor, accepts, quantity

_BY_SENSOR = accepts(NumberBySensor(transducers=True))


@dataclass(frozen=True)
class ThirdOrderPressure:
    """The output has a term in the cube of the pressure."""

    uV_per_psi3: BySensor = field(default=0.0, metadata=_BY_SENSOR)


@dataclass(frozen=True)
class PressureSquaredTemperature:
    """The nonlinearity moves with a temperature."""

    sensor_nV_per_psi2_degC: BySensor = field(default=0.0, metadata=_BY_SENSOR)
    sse_nV_per_psi2_degC: BySensor = field(default=0.0, metadata=_BY_SENSOR)


@dataclass(frozen=True)
class PressureTemperatureSquared:
    """The sensitivity's change with temperature is curved."""

    sensor_nV_per_psi_degC2: BySensor = field(default=0.0, metadata=_BY_SENSOR)
    sse_nV_per_psi_degC2: BySensor = field(default=0.0, metadata=_BY_SENSOR)


@dataclass(frozen=True)
class ThirdOrderTemperature:
    """The offset's change with temperature has a cubic part."""

    sensor_nV_per_degC3: BySensor = field(default=0.0, metadata=_BY_SENSOR)
    sse_nV_per_degC3: BySensor = field(default=0.0, metadata=_BY_SENSOR)


@dataclass(frozen=True)
class Hysteresis:
    """The output is higher where the pressure came down to than where it went up to.

    Half the width of the loop, which is a parabola over the pressure: closed at zero and at full scale.
    """

    uV: BySensor = field(default=0.0, metadata=_BY_SENSOR)
    full_scale_psi: float = quantity(5.0, 1e-3, 1e4)

    def shape(self, pressure_psia: float) -> float:
        """Width as a fraction of the widest."""
        x = min(1.0, max(0.0, pressure_psia / self.full_scale_psi))
        return 4.0 * x * (1.0 - x)


@dataclass(frozen=True)
class CarryOver:
    """The diaphragm creeps: a fraction of every step of pressure is still missing, decaying with time."""

    pct: BySensor = field(default=0.0, metadata=_BY_SENSOR)
    time_constant_s: float = quantity(60.0, 1e-3, 1e9)


@dataclass(frozen=True)
class ThermalLag:
    """After a change of the sensors' temperature the offset is still on its way: so much per degree of the change."""

    uV_per_degC: BySensor = field(default=0.0, metadata=_BY_SENSOR)
    time_constant_s: float = quantity(7200.0, 1.0, 1e9)


@dataclass(frozen=True)
class ThermalTranspiration:
    """The line between the room and the cold transducers has this bore; the bench without the effect has a wide one."""

    bore_mm: float = quantity(0.0, 0.0, 100.0)


@dataclass(frozen=True)
class WholeplotDrift:
    """The transducers' offsets move with time, counted from the start of the world: later whole plots stand apart."""

    uV_per_h: BySensor = field(default=0.0, metadata=_BY_SENSOR)


@dataclass(frozen=True)
class ExcitationDrift:
    """The bridges' excitation drifts, and their sensitivity with it, counted from the start of the world."""

    ppm_per_h: BySensor = field(default=0.0, metadata=_BY_SENSOR)


@dataclass(frozen=True)
class ExcitationTemperature:
    """The supply of all bridges follows the electronics' temperature: outputs scale, zeros and all."""

    ppm_per_sse_degC: float = quantity(0.0, -1e5, 1e5)


@dataclass(frozen=True)
class ThermalGradient:
    """While its temperature changes one side of a transducer is warmer than the other."""

    uV_per_degC_per_h: BySensor = field(default=0.0, metadata=_BY_SENSOR)


@dataclass(frozen=True)
class OffsetJump:
    """At some moment, counted from the start of the world, offsets jump and nobody notes it."""

    jump_uV: BySensor = field(default=0.0, metadata=_BY_SENSOR)
    at_h: float = quantity(12.0, 0.0, 1e5)


@dataclass(frozen=True)
class ReferenceNonlinearity:
    """The gauge that the controller goes by is not straight: the pressure is off by so much of its cube."""

    upsi_per_psi3: float = quantity(0.0, -1e6, 1e6)


@dataclass(frozen=True)
class ColdColumn:
    """The gas in the line's last stretch, this far down to the transducers, is as cold as they are, and weighs more."""

    drop_m: float = quantity(0.0, -100.0, 100.0)

    def over(self, sensor_degC: float, room_degC: float) -> float:
        """Pressure at the transducers over what it is with the whole column at room temperature."""
        per_m = 0.0280134 * 9.80665 / 8.314463  # nitrogen, K/m
        return exp(per_m * self.drop_m * (1.0 / (sensor_degC + 273.15) - 1.0 / (room_degC + 273.15)))


@dataclass(frozen=True)
class PressureEffects:
    """The `[effects]` of a world that a pressure bench can have."""

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
