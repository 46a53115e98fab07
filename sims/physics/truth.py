"""World files (`world.toml`): the truth behind a simulated bench.

The fit and the trace never read it. Every key carries its unit; `rig explain world` prints each. The default
world has ideal effects, ordinary sensors and an ordinary day.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

from rig.sims.physics.by_hand import PersonTruth, VoltmeterTruth
from rig.sims.physics.fields import Moment, Switch, Whole, WorldError, accepts, known_keys, quantity, read_table
from rig.sims.physics.laboratory_truth import (
    ANY,
    AnySensorTruth,
    DrawTruth,
    LagTruth,
    SourceTruth,
    StandardTruth,
    Tables,
)
from rig.sims.physics.pressure_line import LineTruth
from rig.sims.physics.pressure_truth import ChamberTruth, TransducerTruth, ordinary
from rig.sims.physics.undeclared import Effects
from rig.sims.physics.undeclared_pressure import PressureEffects

FAULTS = "faults"
"""The key of the faults, which are not physics (`rig.sims.faults`)."""

_ANGLES = frozenset({"pitch_deg", "roll_deg"})
_PRESSURE_BENCH = frozenset({"pressure_psia", "sensor_temperature_degC", "sse_temperature_degC"})

__all__ = [
    "FAULTS",
    "SENSORS",
    "EnclosureTruth",
    "HeadTruth",
    "LabTruth",
    "MountingTruth",
    "PackageTruth",
    "SensorTruth",
    "Truth",
    "WorldError",
]


@dataclass(frozen=True)
class SensorTruth:
    """One accelerometer: `[sensors.NAME]`, NAME as on the bench.

    Its sensitive axis is on a cone about its package axis: coning is the half angle of the cone, azimuth the position
    on it (appendix A). A single axis without roll, eq. (1), is an x sensor with azimuth 90 deg; its coning is the
    misalignment phi.

    Attributes:
        offset_V: output at zero g.
        sensitivity_V_per_g: output per g.
        coning_deg: half angle of the cone.
        azimuth_deg: position on the cone.
        noise_V: standard deviation of a mean over 1 s; over t seconds it is this divided by sqrt(t).
    """

    offset_V: float = quantity(0.0, -10.0, 10.0)
    sensitivity_V_per_g: float = quantity(5.0, -100.0, 100.0)
    coning_deg: float = quantity(0.0, 0.0, 90.0)
    azimuth_deg: float = quantity(0.0, -360.0, 360.0)
    noise_V: float = quantity(25e-6, 0.0, 1.0)


SENSORS: Mapping[str, SensorTruth] = {
    "x": SensorTruth(offset_V=0.0123, sensitivity_V_per_g=5.02, coning_deg=0.21, azimuth_deg=37.0),
    "y": SensorTruth(offset_V=-0.0087, sensitivity_V_per_g=4.97, coning_deg=0.34, azimuth_deg=-118.0),
    "z": SensorTruth(offset_V=0.0045, sensitivity_V_per_g=5.05, coning_deg=0.15, azimuth_deg=152.0),
}
"""Default sensors of a world without their tables, by axis."""


@dataclass(frozen=True)
class PackageTruth:
    """The package that holds the sensors: `[package]`.

    Attributes:
        pendulum_time_constant_s: time constant of the sensors' first-order lag behind the attitude (0.3 s is the 0.5 Hz
            filter of static attitude sensors).
        thermal_time_constant_s: time constant of the package's temperature behind the enclosure's.
    """

    pendulum_time_constant_s: float = quantity(0.3, 1e-3, 60.0)
    thermal_time_constant_s: float = quantity(1200.0, 1.0, 1e6)


@dataclass(frozen=True)
class MountingTruth:
    """Orientation of the package on the head's table: `[mounting]`. A dry run sets it as the procedure requires.

    Attributes:
        x_deg: rotation about the package's x axis, first.
        y_deg: rotation about its y axis, second.
        z_deg: rotation about its z axis, last.
        error_deg: standard deviation of the error of a mounted orientation, about each axis.
    """

    x_deg: float = quantity(0.0, -180.0, 180.0)
    y_deg: float = quantity(0.0, -180.0, 180.0)
    z_deg: float = quantity(0.0, -180.0, 180.0)
    error_deg: float = quantity(0.01, 0.0, 10.0)


@dataclass(frozen=True)
class LabTruth:
    """The laboratory's temperature, and what hygrometers and barometers in it read: `[lab]`.

    Attributes:
        mean_degC: mean over a day, at the start of the world.
        daily_amplitude_degC: amplitude of the daily cycle.
        warmest_hour_utc: hour of the day at which it is warmest.
        drift_degC_per_day: additional slow drift.
        humidity_pct: relative humidity, constant.
        pressure_hPa: pressure of the air, constant.
    """

    mean_degC: float = quantity(21.5, -50.0, 60.0)
    daily_amplitude_degC: float = quantity(1.5, 0.0, 30.0)
    warmest_hour_utc: float = quantity(16.0, 0.0, 24.0)
    drift_degC_per_day: float = quantity(0.0, -20.0, 20.0)
    humidity_pct: float = quantity(45.0, 0.0, 100.0)
    pressure_hPa: float = quantity(1013.25, 100.0, 1500.0)


@dataclass(frozen=True)
class EnclosureTruth:
    """The enclosure around the package, with temperature control: `[enclosure]`.

    Attributes:
        start_setpoint_degC: setpoint at the start of the world; its state is steady there.
        start_controlled: whether control is on at the start of the world.
        leak: fraction of the laboratory's changes that passes the control.
        time_constant_s: time constant of the control of air temperature.
        slew_degC_per_min: maximum rate of the air.
        free_time_constant_s: time constant of the air relative to the laboratory with control off.
        authority_degC: difference from the laboratory that full power reaches.
    """

    start_setpoint_degC: float = quantity(23.0, -100.0, 200.0)
    start_controlled: bool = field(default=True, metadata=accepts(Switch()))
    leak: float = quantity(0.2, 0.0, 1.0)
    time_constant_s: float = quantity(300.0, 1.0, 1e6)
    slew_degC_per_min: float = quantity(1.0, 1e-3, 100.0)
    free_time_constant_s: float = quantity(3600.0, 1.0, 1e6)
    authority_degC: float = quantity(30.0, 0.1, 500.0)


@dataclass(frozen=True)
class HeadTruth:
    """The dividing head's mechanics: `[head]`.

    Attributes:
        start_pitch_deg: angle of the pitch axis at the start of the world, counted from its encoder's mark.
        start_roll_deg: angle of the roll axis, likewise.
        backlash_arcsec: play in the gear. The encoder is on the table, behind the gear: on a reversal the table waits
            while the motor crosses the play, and no angle is wrong. Play that the encoder cannot see is an effect,
            `[effects.backlash]`.
        creep_arcsec: distance from its target at the end of the motion profile; the axis creeps the rest.
        creep_time_constant_s: time constant of the creep.
    """

    start_pitch_deg: float = quantity(4.0, -180.0, 180.0)
    start_roll_deg: float = quantity(-7.0, -180.0, 180.0)
    backlash_arcsec: float = quantity(3.0, 0.0, 3600.0)
    creep_arcsec: float = quantity(3.0, 0.0, 3600.0)
    creep_time_constant_s: float = quantity(0.5, 1e-3, 60.0)


@dataclass(frozen=True)
class _SensorTables:
    """`[sensors.NAME]` tables; a sensor of the bench without a table gets default values."""

    def read(self, value: object, where: str, axes: Mapping[str, str]) -> Mapping[str, Any]:
        """The checked value."""
        if not isinstance(value, Mapping):
            raise WorldError(f"{where} must be tables, [{where}.NAME]")
        known_keys(value, axes, where, "on this bench")
        numbers = {name: n for n, name in enumerate((name for name, axis in axes.items() if not axis), start=1)}
        usual: dict[str, SensorTruth | TransducerTruth | AnySensorTruth] = {
            name: AnySensorTruth() if axis == ANY else SENSORS[axis] if axis else ordinary(numbers[name])
            for name, axis in axes.items()
        }
        return {name: read_table(usual[name], value.get(name, {}), f"{where}.{name}", axes) for name in axes}


@dataclass(frozen=True)
class Truth:
    """A whole world file.

    Attributes:
        seed: key of all noise.
        epoch: UTC at virtual time zero, seconds since 1970-01-01; None leaves it to the caller.
        sensors: truth by sensor name, one for every sensor on the bench.
    """

    seed: int = field(default=1, metadata=accepts(Whole()))
    epoch: float | None = field(default=None, metadata=accepts(Moment()))
    sensors: Mapping[str, SensorTruth | TransducerTruth | AnySensorTruth] = field(
        default_factory=dict, metadata=accepts(_SensorTables())
    )
    sources: Mapping[str, SourceTruth] = field(default_factory=dict, metadata=accepts(Tables(SourceTruth)))
    lags: Mapping[str, LagTruth] = field(default_factory=dict, metadata=accepts(Tables(LagTruth)))
    draws: Mapping[str, DrawTruth] = field(default_factory=dict, metadata=accepts(Tables(DrawTruth)))
    references: Mapping[str, StandardTruth] = field(default_factory=dict, metadata=accepts(Tables(StandardTruth)))
    package: PackageTruth = field(default_factory=PackageTruth)
    mounting: MountingTruth = field(default_factory=MountingTruth)
    lab: LabTruth = field(default_factory=LabTruth)
    enclosure: EnclosureTruth = field(default_factory=EnclosureTruth)
    head: HeadTruth = field(default_factory=HeadTruth)
    sensor_chamber: ChamberTruth = field(default_factory=ChamberTruth)
    sse_chamber: ChamberTruth = field(default_factory=ChamberTruth)
    pressure_line: LineTruth = field(default_factory=LineTruth)
    voltmeter: VoltmeterTruth = field(default_factory=VoltmeterTruth)
    person: PersonTruth = field(default_factory=PersonTruth)
    effects: Effects = field(default_factory=Effects)


def sensor_axes(bench: Mapping[str, Any]) -> Mapping[str, str]:
    """Package axis ("x", "y", "z") by sensor name, as on the bench; "" for a pressure transducer, `ANY` for a sensor of
    any other laboratory.
    """
    if any_laboratory(bench):
        return dict.fromkeys(bench["sensors"], ANY)
    return {name: str(table.get("axis") or "") for name, table in bench.get("sensors", {}).items()}


def any_laboratory(bench: Mapping[str, Any]) -> bool:
    """Whether a bench is of no particular kind: it has factors beyond those of the pressure bench, or none and
    limits of a head, or references, or outputs in other units than volts.
    """
    sensors = bench.get("sensors", {}).values()
    if any(table.get("axis") for table in sensors):
        return False
    units = {str(table.get("unit", "V")) for table in sensors}
    factors = set(bench.get("factors", {}))
    head = not factors and _ANGLES & set(bench.get("limits", {}))
    return bool(factors - _PRESSURE_BENCH or (sensors and head) or bench.get("references") or units - {"V", "mV"})


def read_truth(values: Mapping[str, object], axes: Mapping[str, str]) -> Truth:
    """Check the values of a world file.

    Args:
        values: the file's plain values, {} for the default world; its faults are checked elsewhere.
        axes: see `sensor_axes`.

    Raises:
        WorldError: with the key, its defect and permitted values.
    """
    own = {key: value for key, value in values.items() if key != FAULTS}
    truth = read_table(Truth(), {"sensors": {}, **own}, "", axes)
    effects = values.get("effects")
    if effects and ANY in axes.values():
        raise WorldError("effects are those of attitude sensors and transducers; write `hidden` of [sensors.NAME]")
    for name in effects if isinstance(effects, Mapping) else ():
        of_transducers = name in {f.name for f in fields(PressureEffects)}
        if axes and not any((not axis) == of_transducers for axis in axes.values()):
            kind = "pressure transducers" if of_transducers else "attitude sensors"
            raise WorldError(f"effects.{name} is of {kind}, and this bench has none")
    return truth
