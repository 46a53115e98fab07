"""What truly happened on a simulated bench, for checkers that know nothing of drivers: readings and commands.

Nothing in a run reads it. A checker asks what a sensor truly gave at a moment, whatever was said on a wire.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from math import nan
from typing import NamedTuple

from sims.physics import Plant
from sims.physics.chamber import Chamber
from sims.physics.thermal import Enclosure
from sims.physics.told import Told
from sims.twin import Measuring, Twin
from sims.world import World


class Reading(NamedTuple):
    """A number that a meter or data-acquisition unit made of its input.

    Attributes:
        t_s: begin of the window, world time.
        end_s: its end.
        instrument: the meter.
        channel: its input.
        unit: "V" or "degC".
        true: what the sensor gave over the window, without noise; faults of the input are not in it.
        found: the number that the converter made of it, its noise and the sensor's included; so far no fault of the
            input is in it.
        given: the number said; an overload is 9.9e37, on the data-acquisition unit anything beyond its range.
        factors: what was true in the middle of the window: pitch_deg and roll_deg of the table, or pressure_psia at
            the transducers (mean over the window), and sensor_temperature_degC, sse_temperature_degC.
        sides: from which side pitch_deg and roll_deg, or pressure_psia, had come there: 1 going up, -1, 0 if neither.
        stay: number of the stay at a pair of temperatures, as the transducers' own errors count; 0 without transducers.
        air_degC: of every chamber in the middle of the window, by instrument.

    """

    t_s: float
    end_s: float
    instrument: str
    channel: str
    unit: str
    true: float
    found: float
    given: float
    factors: Mapping[str, float]
    sides: Mapping[str, int]
    stay: int
    air_degC: Mapping[str, float]


class Readback(NamedTuple):
    """A pressure that a pressure controller read of its line.

    Attributes:
        t_s: world time.
        instrument: the controller.
        true: pressure at the transducers, psi.
        given: the number said, psi; its own sensor's errors and noise are in it, and so is any fault.

    """

    t_s: float
    instrument: str
    true: float
    given: float


class Change(NamedTuple):
    """Something that safety depends on was commanded, or reached.

    A command is noted whenever it is given, also one that changes nothing; what is on or off, when it changes.

    Attributes:
        t_s: world time.
        instrument: whose.
        what: "control" (of a pressure: "on" or "off"; of a chamber likewise), "setpoint_psia", "slew_psi_per_s",
            "vent" ("open", "complete", "off"), "setpoint_degC", "door" ("open", "closed"), and of a head
            "pitch target_deg", "pitch reached_deg", "pitch stopped_deg", "pitch stalled_deg"; likewise "roll".
        value: what it is from now on.

    """

    t_s: float
    instrument: str
    what: str
    value: float | str


_STATES = ("on", "off", "closed")


class Tape:
    """Listens to a simulated bench from now on.

    Args:
        world: virtual time.
        plant: what is there.
        twins: by instrument.
        heard: told of everything as it happens, before anybody else; readings and readbacks are then not kept here.

    Attributes:
        readings: of meters and data-acquisition units, in the order in which they were made.
        readbacks: of pressure controllers, likewise.
        changes: in order.

    """

    def __init__(
        self,
        world: World,
        plant: Plant,
        twins: Mapping[str, Twin],
        heard: Callable[[Reading | Readback | Change], None] | None = None,
    ) -> None:
        self._heard = heard
        self.readings: list[Reading] = []
        self.readbacks: list[Readback] = []
        self.changes: list[Change] = []
        self._world = world
        self._plant = plant
        self._last: dict[tuple[str, str], float | str] = {}
        self._chambers: dict[str, Chamber | Enclosure] = {}
        self._then = (nan, nan)
        self._there: tuple[Mapping[str, float], Mapping[str, int], int, Mapping[str, float]] = ({}, {}, 0, {})
        for name, twin in twins.items():
            told = partial(self._change, name)
            if "pressure-controller" in twin.roles:
                plant.pressure_line(name).told = told
            if "chamber" in twin.roles:
                self._chambers[name] = plant.chamber(name)
                self._chambers[name].told = told
            if "head" in twin.roles:
                for axis, mechanics in plant.head.axes.items():
                    mechanics.told = self._axis(name, axis)
            if isinstance(twin, Measuring) and twin.roles & {"reader", "pressure-controller"}:
                twin.inputs.heard = partial(self._heard_at_input, name)

    def _heard_at_input(
        self, instrument: str, channel: str, unit: str, t0: float, t1: float, found: float, given: float
    ) -> None:
        if unit == "psi":
            self._readback(instrument, t0, given)
        else:
            self._reading(instrument, channel, unit, t0, t1, found, given)

    def _reading(
        self, instrument: str, channel: str, unit: str, t0: float, t1: float, found: float, given: float
    ) -> None:
        plant, middle = self._plant, (t0 + t1) / 2.0
        true = (
            plant.clean_V(instrument, channel, t0, t1)
            if unit == "V"
            else plant.channel_degC(instrument, channel, middle)
        )
        if self._then != (t0, t1):  # a unit that measures all its inputs at once asks only once where everything is
            air = {name: chamber.air_degC(middle) for name, chamber in self._chambers.items()}
            self._then = t0, t1
            self._there = plant.factors(t0, t1), plant.sides(middle), plant.stay(middle), air
        reading = Reading(t0, t1, instrument, channel, unit, true, found, given, *self._there)
        if self._heard is None:
            self.readings.append(reading)
        else:
            self._heard(reading)

    def _readback(self, instrument: str, t: float, given: float) -> None:
        readback = Readback(t, instrument, self._plant.pressure_line(instrument).pressure_psia(t), given)
        if self._heard is None:
            self.readbacks.append(readback)
        else:
            self._heard(readback)

    def _change(self, instrument: str, what: str, value: float | str, after_s: float = 0.0) -> None:
        """Note a change; one that is still to come only if nothing else happens to it before."""
        if after_s > 0.0:
            count, subject = len(self.changes), what.partition(" ")[0]

            def due() -> None:
                since = self.changes[count:]
                if not any(c.instrument == instrument and c.what.partition(" ")[0] == subject for c in since):
                    self._change(instrument, what, value)

            self._world.call_in(after_s, due)
        elif value not in _STATES or self._last.get((instrument, what)) != value:
            self._last[instrument, what] = value
            change = Change(self._world.now(), instrument, what, value)
            self.changes.append(change)
            if self._heard is not None:
                self._heard(change)

    def _axis(self, name: str, axis: str) -> Told:
        def told(what: str, value: float | str, after_s: float = 0.0, /) -> None:
            self._change(name, f"{axis} {what}", value, after_s)

        return told
