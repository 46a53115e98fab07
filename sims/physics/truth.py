"""What a world file (`world.toml`) may say: the truth behind a simulated bench.

The fit and the trace never read it. Every key carries its unit; docs/worlds.md explains each. Without a file the
world is a plain one: ideal effects, ordinary sensors, an ordinary day.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

from sims.physics.fields import Moment, Switch, Whole, WorldError, accepts, known_keys, quantity, read_table
from sims.physics.pressure_line import LineTruth
from sims.physics.pressure_truth import ChamberTruth, TransducerTruth, ordinary
from sims.physics.undeclared import Effects
from sims.physics.undeclared_pressure import PressureEffects

FAULTS = "faults"
"""The key of what goes wrong, which is no physics (`sims.faults`)."""

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

    Its sensitive axis lies on a cone about the package axis it is named for: coning is the cone's half angle,
    azimuth the place on it (appendix A). A single axis without roll, eq. (1), is an x sensor with azimuth 90 deg,
    its coning being the misalignment phi.

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
"""The sensors of a world that does not describe them, by axis."""


@dataclass(frozen=True)
class PackageTruth:
    """The package that holds the sensors: `[package]`.

    Attributes:
        pendulum_time_constant_s: the sensors' output follows a change of attitude with this first-order lag
            (0.3 s is the 0.5 Hz filter that static attitude sensors carry).
        thermal_time_constant_s: the package's temperature follows the enclosure's.

    """

    pendulum_time_constant_s: float = quantity(0.3, 1e-3, 60.0)
    thermal_time_constant_s: float = quantity(1200.0, 1.0, 1e6)


@dataclass(frozen=True)
class MountingTruth:
    """How the package sits on the head's table: `[mounting]`. A dry run puts there what the procedure asks for.

    Attributes:
        x_deg: turned about the package's x axis, first.
        y_deg: about its y axis, second.
        z_deg: about its z axis, last.
        error_deg: a package that was turned never sits quite as it should: standard deviation about each axis.

    """

    x_deg: float = quantity(0.0, -180.0, 180.0)
    y_deg: float = quantity(0.0, -180.0, 180.0)
    z_deg: float = quantity(0.0, -180.0, 180.0)
    error_deg: float = quantity(0.01, 0.0, 10.0)


@dataclass(frozen=True)
class LabTruth:
    """The laboratory's temperature: `[lab]`.

    Attributes:
        mean_degC: mean over a day, at the start of the world.
        daily_amplitude_degC: half of the day's swing.
        warmest_hour_utc: hour of the day at which it is warmest.
        drift_degC_per_day: slow change on top.

    """

    mean_degC: float = quantity(21.5, -50.0, 60.0)
    daily_amplitude_degC: float = quantity(1.5, 0.0, 30.0)
    warmest_hour_utc: float = quantity(16.0, 0.0, 24.0)
    drift_degC_per_day: float = quantity(0.0, -20.0, 20.0)


@dataclass(frozen=True)
class EnclosureTruth:
    """The enclosure around the package, whose temperature a controller holds: `[enclosure]`.

    Attributes:
        start_setpoint_degC: setpoint when the world starts; it has stood there long enough to be steady.
        start_controlled: whether control is on when the world starts.
        leak: fraction of the laboratory's change that gets past the controller.
        time_constant_s: how fast control brings the air to a new setpoint.
        slew_degC_per_min: no faster than this, whatever the setpoint.
        free_time_constant_s: how fast the air follows the laboratory when control is off.
        authority_degC: how far above or below the laboratory full power would bring it.

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
        start_pitch_deg: where the pitch axis stands when the world starts, counted from its encoder's mark.
        start_roll_deg: the same of the roll axis.
        backlash_arcsec: play in the gear. The encoder sits on the table, behind the gear: on a reversal the table
            waits while the motor crosses the play, and no angle is wrong. Play that the encoder cannot see is
            an effect, `[effects.backlash]`.
        creep_arcsec: how far before its target an axis is when its motion profile ends; the rest it creeps.
        creep_time_constant_s: how fast it creeps.

    """

    start_pitch_deg: float = quantity(4.0, -180.0, 180.0)
    start_roll_deg: float = quantity(-7.0, -180.0, 180.0)
    backlash_arcsec: float = quantity(3.0, 0.0, 3600.0)
    creep_arcsec: float = quantity(3.0, 0.0, 3600.0)
    creep_time_constant_s: float = quantity(0.5, 1e-3, 60.0)


@dataclass(frozen=True)
class _SensorTables:
    """`[sensors.NAME]` tables; every sensor on the bench gets one, an ordinary sensor's where none is given."""

    def read(self, value: object, where: str, axes: Mapping[str, str]) -> Mapping[str, SensorTruth | TransducerTruth]:
        """See `fields.Kind.read`."""
        if not isinstance(value, Mapping):
            raise WorldError(f"{where} must be tables, [{where}.NAME]")
        known_keys(value, axes, where, "on this bench")
        numbers = {name: n for n, name in enumerate((name for name, axis in axes.items() if not axis), start=1)}
        usual = {name: SENSORS[axis] if axis else ordinary(numbers[name]) for name, axis in axes.items()}
        return {name: read_table(usual[name], value.get(name, {}), f"{where}.{name}", axes) for name in axes}


@dataclass(frozen=True)
class Truth:
    """A whole world file.

    Attributes:
        seed: key of all noise.
        epoch: UTC at virtual time zero, seconds since 1970-01-01; None leaves it to whoever makes the world.
        sensors: truth by sensor name, one for every sensor on the bench.

    """

    seed: int = field(default=1, metadata=accepts(Whole()))
    epoch: float | None = field(default=None, metadata=accepts(Moment()))
    sensors: Mapping[str, SensorTruth | TransducerTruth] = field(
        default_factory=dict, metadata=accepts(_SensorTables())
    )
    package: PackageTruth = field(default_factory=PackageTruth)
    mounting: MountingTruth = field(default_factory=MountingTruth)
    lab: LabTruth = field(default_factory=LabTruth)
    enclosure: EnclosureTruth = field(default_factory=EnclosureTruth)
    head: HeadTruth = field(default_factory=HeadTruth)
    sensor_chamber: ChamberTruth = field(default_factory=ChamberTruth)
    sse_chamber: ChamberTruth = field(default_factory=ChamberTruth)
    pressure_line: LineTruth = field(default_factory=LineTruth)
    effects: Effects = field(default_factory=Effects)


def sensor_axes(bench: Mapping[str, Any]) -> Mapping[str, str]:
    """Package axis ("x", "y", "z") by sensor name, as on the bench; "" for a pressure transducer."""
    return {name: str(table.get("axis") or "") for name, table in bench.get("sensors", {}).items()}


def read_truth(values: Mapping[str, object], axes: Mapping[str, str]) -> Truth:
    """Check the values of a world file.

    Args:
        values: the file's plain values, {} for a world without surprises; its faults are checked elsewhere.
        axes: see `sensor_axes`.

    Raises:
        WorldError: naming the key, what is wrong with it and what would be right.

    """
    own = {key: value for key, value in values.items() if key != FAULTS}
    truth = read_table(Truth(), {"sensors": {}, **own}, "", axes)
    effects = values.get("effects")
    for name in effects if isinstance(effects, Mapping) else ():
        of_transducers = name in {f.name for f in fields(PressureEffects)}
        if axes and not any((not axis) == of_transducers for axis in axes.values()):
            kind = "pressure transducers" if of_transducers else "attitude sensors"
            raise WorldError(f"effects.{name} is of {kind}, and this bench has none")
    return truth
