"""The whole physical state, for the twins."""

# ruff: noqa: N802  (a quantity's name ends in its unit, and units keep their own case)

from __future__ import annotations

from collections.abc import Collection, Mapping
from math import inf, radians, sqrt
from typing import Any, Protocol
from zlib import crc32

from rig.sims.noise import event_at, normal
from rig.sims.physics.attitude import Accelerometer
from rig.sims.physics.by_hand import OTHER_VOLTMETER, PADS_LOCKED, REMOUNTED, Drawn
from rig.sims.physics.chamber import Chamber
from rig.sims.physics.head import HeadMechanics
from rig.sims.physics.laboratory import Laboratory, Source
from rig.sims.physics.pressure_line import PressureLine
from rig.sims.physics.pressure_stand import PressureStand
from rig.sims.physics.rotations import (
    Matrix,
    Vector,
    apply,
    compose,
    pitch_matrix,
    roll_matrix,
    turned_gravity,
    yaw_matrix,
)
from rig.sims.physics.thermal import Enclosure, Lab
from rig.sims.physics.truth import MountingTruth, SensorTruth, Truth, read_truth, sensor_axes
from rig.sims.physics.undeclared import IsolationPad

_GAUSS_3 = ((-sqrt(0.6), 5.0 / 18.0), (0.0, 8.0 / 18.0), (sqrt(0.6), 5.0 / 18.0))
"""Nodes on -1..1 and weights (summing to 1) of three-point Gauss-Legendre quadrature."""

_QUIET = 12.0
"""Pendulum time constants after the end of a motion profile until a window's middle represents the whole window."""


class Time(Protocol):
    """Parts of a world that the plant needs."""

    def now(self) -> float:
        """Virtual seconds."""
        ...

    def utc(self) -> float:
        """Virtual UTC, seconds since 1970-01-01."""
        ...


class Plant:
    """The whole physical state: head, package, pressure, temperatures. Pure functions of virtual time.

    Args:
        world: virtual time.
        truth: values of the world file; {} for the default world.
        bench: values of the bench file. Its [sensors] and [temperatures] give the channel of each sensor; its [factors]
            give the instrument of the transducers' line and of the chambers of transducers and electronics.
        heads: names of the instruments on the bench that move the head.

    Attributes:
        enclosure: around the package of an attitude bench.
        head: carries the package.
        stand: pressure line, chambers and transducers of a pressure bench.

    Raises:
        WorldError: the world file has an unknown key or an impossible value.
    """

    def __init__(
        self, world: Time, truth: Mapping[str, object], bench: Mapping[str, object], heads: Collection[str] = ()
    ) -> None:
        sensors: Mapping[str, Mapping[str, object]] = _tables(bench, "sensors")
        axes = sensor_axes(bench)
        self.truth: Truth = read_truth(truth, axes)
        t = self.truth
        self._seed = t.seed
        self._lab = Lab(t.lab, world.utc() - world.now())
        self._pad = t.effects.isolation_pad
        self._mounting = _mounted(t.mounting, t.seed)
        self._voltmeter, self._drawn, self._remounted = t.voltmeter, Drawn(t.seed), 0
        self._pendulum_s = t.package.pendulum_time_constant_s
        self.enclosure = Enclosure(t.enclosure, t.package.thermal_time_constant_s, self._lab, world.now())
        self.head = HeadMechanics(world, t.head, t.effects.backlash, t.effects.head_error, self._pendulum_s)
        self._latest: dict[str, tuple[float, float, float]] = {}
        self._pitch, self._roll = self.head.axes["pitch"], self.head.axes["roll"]
        self._sensors = {
            name: Accelerometer(name, axes[name], sensor, t.effects)
            for name, sensor in t.sensors.items()
            if isinstance(sensor, SensorTruth)
        }
        factors = {factor: str(instrument) for factor, instrument in _tables(bench, "factors").items()}
        self.stand = PressureStand(t, factors, self._lab, world.now())
        angles = {f"{name}_deg": axis for name, axis in self.head.axes.items()} if heads else {}
        own = {f: axis for f, axis in angles.items() if f not in factors or factors[f] in heads}
        self.laboratory = Laboratory(t, bench, self._lab, world.now(), own)
        self._world = world
        self._standards = {_wire(table): name for name, table in _tables(bench, "references").items()}
        self._columns = {_wire(table): name for name, table in _tables(bench, "temperatures").items()}
        self._volts = {_wire(table): name for name, table in sensors.items()}
        temperatures = _tables(bench, "temperatures").values()
        self._places = {_wire(table): str(table.get("place", "package")) for table in temperatures}

    def source(self, instrument: str) -> Source:
        """The quantity behind a source of the bench."""
        return self.laboratory.source(instrument)

    def set_by_hand(self, factor: str, value: float) -> None:
        """A person sets a factor. The setting is in force at once."""
        self._latest.clear()
        self.laboratory.by_hand(factor, value, self._world.now())

    def chamber(self, instrument: str) -> Chamber | Enclosure:
        """The object of a temperature controller of the bench: a chamber, or otherwise the enclosure around the
        package.
        """
        return self.laboratory.chamber(instrument) or self.stand.chamber(instrument) or self.enclosure

    def by_hand(self, change: str) -> None:
        """A person changes the bench by hand; see `rig.sims.physics.by_hand`. The change is in force at once."""
        self._latest.clear()
        self._drawn.another(change)
        if change == PADS_LOCKED:
            self._pad = IsolationPad()
        elif change == REMOUNTED:
            self._remounted += 1
            self._mounting = _mounted(self.truth.mounting, self._seed, self._remounted)
        elif change == OTHER_VOLTMETER:
            self._voltmeter = self._drawn.voltmeter(self.truth.voltmeter)
        self.stand.by_hand(change, self._drawn)
        self.laboratory.changed(change)

    def pressure_line(self, instrument: str) -> PressureLine:
        """The line behind a pressure controller of the bench."""
        line = self.stand.line(instrument)
        self.laboratory.set_by(instrument, line.pressure_psia)
        return line

    def gravity(self, t: float) -> Vector:
        """Gravity in the axes of the package's sensors, g: head angles, mounting, then the pads' deflection."""
        down = turned_gravity(radians(self._pitch.seen_deg(t)), radians(self._roll.seen_deg(t)))
        return self._pad.deflect(down if self._mounting is None else apply(self._mounting, down))

    def sensor_V(self, sensor: str, t0: float, t1: float) -> float:
        """Mean output of a sensor over an integration window, noise included.

        The noise is a function of the window: the same sensor and the same window give the same reading.

        Args:
            sensor: its name on the bench.
            t0: begin of the window, virtual seconds.
            t1: its end, later than `t0`.

        Returns:
            Volts.
        """
        accelerometer = self._sensors.get(sensor)
        if accelerometer is not None:
            noise = accelerometer.noise / sqrt(t1 - t0)
            return self._clean(sensor, t0, t1) + noise * normal(self._seed, accelerometer.channel, event_at(t0))
        if sensor in self.stand.transducers:
            return self._clean(sensor, t0, t1) + self.stand.noise_V(sensor, t0, t1)
        return self._clean(sensor, t0, t1) + self.laboratory.volts(sensor, self.laboratory.noise(sensor, t0, t1))

    def clean_V(self, instrument: str, channel: str, t0: float, t1: float) -> float:
        """Mean output of the sensor at an input over a window, without noise; 0 V without a sensor."""
        standard = self._standards.get((instrument, channel))
        if standard is not None:
            return self.laboratory.standard(standard, t0, t1, noisy=False)
        sensor = self._volts.get((instrument, channel))
        return 0.0 if sensor is None else self._clean(sensor, t0, t1)

    def _clean(self, sensor: str, t0: float, t1: float) -> float:
        """Mean output of a sensor without noise; the latest window of each is cached."""
        latest = self._latest.get(sensor)
        if latest is not None and latest[0] == t0 and latest[1] == t1:
            return latest[2]
        accelerometer = self._sensors.get(sensor)
        if accelerometer is not None:
            output = self._tilt_V(accelerometer, t0, t1)
        elif sensor in self.stand.transducers:
            output = self.stand.clean_V(sensor, t0, t1)
        else:
            output = self.laboratory.volts(sensor, self.laboratory.clean(sensor, t0, t1))
        output = self._voltmeter.reads_V(output)
        self._latest[sensor] = (t0, t1, output)
        return output

    def _tilt_V(self, accelerometer: Accelerometer, t0: float, t1: float) -> float:
        """Mean output of an accelerometer without noise."""
        middle, half = (t0 + t1) / 2.0, (t1 - t0) / 2.0
        still = max(self._pitch.leg(t1).end, self._roll.leg(t1).end)
        if t0 >= still + _QUIET * self._pendulum_s:
            return accelerometer.output_V(self.gravity(middle), self.enclosure.package_degC(middle), middle)
        degC = self.enclosure.package_degC(middle)
        return sum(
            weight * accelerometer.output_V(self.gravity(t), degC, t)
            for t, weight in ((middle + half * node, weight) for node, weight in _GAUSS_3)
        )

    def factors(self, t0: float, t1: float) -> Mapping[str, float]:
        """True values of the factors over a window, by their names in run files."""
        t = (t0 + t1) / 2.0
        if self.laboratory.sensors:
            return self.laboratory.factors(t)
        if self.stand.transducers:
            return {
                "pressure_psia": self.stand.pressure_psia(t0, t1),
                "sensor_temperature_degC": self.stand.sensors_degC(t),
                "sse_temperature_degC": self.stand.sse_degC(t),
            }
        return {
            "pitch_deg": self._pitch.true_deg(t),
            "roll_deg": self._roll.true_deg(t),
            "sensor_temperature_degC": self.enclosure.package_degC(t),
        }

    def sides(self, t: float) -> Mapping[str, int]:
        """True direction of the last approach of each easy-to-change factor: 1 upwards, -1 downwards, 0 if neither.

        An axis that has never moved counts as approached upwards.
        """
        if self.laboratory.sensors:
            return self.laboratory.sides(t)
        if self.stand.transducers:
            return {"pressure_psia": self.stand.side(t)}
        return {"pitch_deg": self._pitch.side(t), "roll_deg": self._roll.side(t)}

    def stay(self, t: float) -> int:
        """Number of the stay at a pair of temperatures, as for the transducers' whole-plot errors; 0 without
        transducers.
        """
        if self.laboratory.sensors:
            return self.laboratory.stay(t)
        return self.stand.whole_plot(t) if self.stand.transducers else 0

    def temperature_degC(self, place: str, t: float) -> float:
        """Temperature at virtual time `t` of a place.

        Args:
            place: "package", "enclosure" (its air), "sensors" (the transducers), "sse" (their electronics) or "lab".
            t: virtual time.

        """
        match place:
            case "package":
                return self.enclosure.package_degC(t)
            case "enclosure":
                return self.enclosure.air_degC(t)
            case "sensors":
                return self.stand.sensors_degC(t)
            case "sse":
                return self.stand.sse_degC(t)
        return self._lab.degC(t)

    def channel_V(self, instrument: str, channel: str, t0: float, t1: float) -> float:
        """Mean voltage at an instrument's input over the window; an open input reads 0 V."""
        wire = (instrument, channel)
        if wire in self._standards:
            return self.laboratory.standard(self._standards[wire], t0, t1, noisy=True)
        sensor = self._volts.get(wire)
        return 0.0 if sensor is None else self.sensor_V(sensor, t0, t1)

    def channel_degC(self, instrument: str, channel: str, t: float) -> float:
        """Temperature of the thermometer at an instrument's input; infinite without a thermometer.

        Of a hygrometer or barometer its own quantity, in the unit of its column.
        """
        column = self._columns.get((instrument, channel))
        if column is not None and not column.endswith("_degC"):
            return self._lab.air(column.rpartition("_")[2])
        if column is not None and self.laboratory.sets(column):
            return self.laboratory.true(column, t)
        place = self._places.get((instrument, channel))
        if place is not None and self.laboratory.sets(place):
            return self.laboratory.true(place, t)
        return inf if place is None else self.temperature_degC(place, t)


def _mounted(truth: MountingTruth, seed: int, again: int = 0) -> Matrix | None:
    """Rotation from the table's axes to the package's, 3x3, mounted again so many times; None if the package is not
    turned, and never was taken off.
    """
    turns = (truth.x_deg, truth.y_deg, truth.z_deg)
    if not any(turns) and not again:
        return None
    x, y, z = (
        radians(turn + truth.error_deg * normal(seed, f"mounting {axis}", crc32(repr(turns).encode()) + again))
        for axis, turn in zip("xyz", turns, strict=True)
    )
    return compose(yaw_matrix(z), compose(pitch_matrix(y), roll_matrix(x)))


def _tables(bench: Mapping[str, object], name: str) -> Mapping[str, Any]:
    found = bench.get(name, {})
    if not isinstance(found, Mapping):
        raise TypeError(f"bench: {name} must be tables")
    return found


def _wire(table: Mapping[str, object]) -> tuple[str, str]:
    """(instrument, channel) of a sensor or thermometer."""
    return str(table["reader"]), str(table.get("channel", "input"))
