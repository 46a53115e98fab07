"""Everything that is physically there, for the twins to look at."""

# ruff: noqa: N802  (a quantity's name ends in its unit, and units keep their own case)

from __future__ import annotations

from collections.abc import Mapping
from math import inf, radians, sqrt
from typing import Protocol

from sims.noise import event_at, normal
from sims.physics.attitude import Accelerometer
from sims.physics.head import HeadMechanics
from sims.physics.rotations import GRAVITY, Vector, apply, pitch_matrix, roll_matrix
from sims.physics.thermal import Enclosure, Lab
from sims.physics.truth import Truth, read_truth

_GAUSS_3 = ((-sqrt(0.6), 5.0 / 18.0), (0.0, 8.0 / 18.0), (sqrt(0.6), 5.0 / 18.0))
"""Nodes on -1..1 and weights (summing to 1) of three-point Gauss-Legendre quadrature."""

_QUIET = 12.0
"""Pendulum time constants after a motion profile's end until a window's middle stands for the whole of it."""


class Time(Protocol):
    """What the plant needs of a world."""

    def now(self) -> float:
        """Virtual seconds."""
        ...

    def utc(self) -> float:
        """Virtual UTC, seconds since 1970-01-01."""
        ...


class Plant:
    """All that is physically there: head angles, package, temperatures. Pure functions of virtual time.

    Args:
        world: virtual time.
        truth: values of the world file; {} for a world without surprises.
        bench: values of the bench file; its [sensors] and [temperatures] say what is wired to which channel.

    Raises:
        WorldError: the world file says something that is not known or cannot be.

    """

    def __init__(self, world: Time, truth: Mapping[str, object], bench: Mapping[str, object]) -> None:
        sensors = _tables(bench, "sensors")
        axes = {name: str(table["axis"]) for name, table in sensors.items()}
        self.truth: Truth = read_truth(truth, axes)
        t = self.truth
        self._seed = t.seed
        self._lab = Lab(t.lab, world.utc() - world.now())
        self._pad = t.effects.isolation_pad
        self._pendulum_s = t.package.pendulum_time_constant_s
        self.enclosure = Enclosure(t.enclosure, t.package.thermal_time_constant_s, self._lab, world.now())
        self.head = HeadMechanics(world, t.head, t.effects.backlash, t.effects.head_error, self._pendulum_s)
        self._pitch, self._roll = self.head.axes["pitch"], self.head.axes["roll"]
        self._sensors = {name: Accelerometer(name, axes[name], t.sensors[name], t.effects) for name in sensors}
        self._volts = {_wire(table): name for name, table in sensors.items()}
        temperatures = _tables(bench, "temperatures").values()
        self._places = {_wire(table): str(table.get("place", "package")) for table in temperatures}

    def chamber(self, instrument: str) -> Enclosure:
        """What a temperature controller of the bench controls: the enclosure around the package."""
        return self.enclosure

    def gravity(self, t: float) -> Vector:
        """Gravity in the axes of the package's sensors, g: head angles, then the pads' deflection."""
        pitch, roll = radians(self._pitch.seen_deg(t)), radians(self._roll.seen_deg(t))
        down = apply(roll_matrix(roll), apply(pitch_matrix(pitch), GRAVITY))
        return self._pad.deflect(down)

    def sensor_V(self, sensor: str, t0: float, t1: float) -> float:
        """Mean output of a sensor over an integration window, noise included.

        The noise belongs to the window: whoever integrates the same sensor over the same window reads the same.

        Args:
            sensor: its name on the bench.
            t0: begin of the window, virtual seconds.
            t1: its end, later than `t0`.

        Returns:
            Volts.

        """
        accelerometer = self._sensors[sensor]
        middle, half = (t0 + t1) / 2.0, (t1 - t0) / 2.0
        still = max(self._pitch.leg(t1).end, self._roll.leg(t1).end)
        if t0 >= still + _QUIET * self._pendulum_s:
            output = accelerometer.output_V(self.gravity(middle), self.enclosure.package_degC(middle), middle)
        else:
            degC = self.enclosure.package_degC(middle)
            output = sum(
                weight * accelerometer.output_V(self.gravity(t), degC, t)
                for t, weight in ((middle + half * node, weight) for node, weight in _GAUSS_3)
            )
        noise = accelerometer.noise / sqrt(t1 - t0)
        return output + noise * normal(self._seed, accelerometer.channel, event_at(t0))

    def temperature_degC(self, place: str, t: float) -> float:
        """Temperature of the "package", the "enclosure" (its air) or the "lab" at virtual time `t`."""
        if place == "package":
            return self.enclosure.package_degC(t)
        return self.enclosure.air_degC(t) if place == "enclosure" else self._lab.degC(t)

    def channel_V(self, instrument: str, channel: str, t0: float, t1: float) -> float:
        """What is at an instrument's voltage input, a mean over the window; an input left open reads 0 V."""
        sensor = self._volts.get((instrument, channel))
        return 0.0 if sensor is None else self.sensor_V(sensor, t0, t1)

    def channel_degC(self, instrument: str, channel: str, t: float) -> float:
        """Temperature of the thermistor at an instrument's input; infinite where none is connected."""
        place = self._places.get((instrument, channel))
        return inf if place is None else self.temperature_degC(place, t)


def _tables(bench: Mapping[str, object], name: str) -> Mapping[str, Mapping[str, object]]:
    found = bench.get(name, {})
    if not isinstance(found, Mapping):
        raise TypeError(f"bench: {name} must be tables")
    return found


def _wire(table: Mapping[str, object]) -> tuple[str, str]:
    """(instrument, channel) that a sensor or thermometer is wired to."""
    return str(table["reader"]), str(table.get("channel", "input"))
