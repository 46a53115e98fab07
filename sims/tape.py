"""True events of a simulated bench, for checkers independent of drivers: readings and commands.

A run does not read it. It gives a checker the true output of a sensor at a time, whatever was sent on a wire.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from math import nan
from typing import NamedTuple

from rig.sims.physics import Plant
from rig.sims.physics.chamber import Chamber
from rig.sims.physics.thermal import Enclosure
from rig.sims.physics.told import Told
from rig.sims.twin import Measuring, Twin
from rig.sims.world import World


class Reading(NamedTuple):
    """A reading of a meter or data-acquisition unit.

    Attributes:
        t_s: begin of the window, world time.
        end_s: its end.
        instrument: the meter.
        channel: its input.
        unit: "V" or "degC".
        true: output of the sensor over the window, without noise and without faults of the input.
        found: the converter's number, with noise of converter and sensor, without faults of the input.
        given: the reported number; an overload is 9.9e37, on the data-acquisition unit any number beyond its range.
        factors: true values in the middle of the window: pitch_deg and roll_deg of the table, or pressure_psia at the
            transducers (mean over the window), and sensor_temperature_degC, sse_temperature_degC.
        sides: direction of the last approach of pitch_deg and roll_deg, or pressure_psia: 1 upwards, -1 downwards, 0 if
            neither.
        stay: number of the stay at a pair of temperatures, as for the transducers' whole-plot errors; 0 without
            transducers.
        air_degC: air temperature of every chamber in the middle of the window, by instrument.
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
    """A pressure controller's reading of its line.

    Attributes:
        t_s: world time.
        instrument: the controller.
        true: pressure at the transducers, psi.
        given: the reported number, psi, with errors and noise of its own sensor and any fault.
    """

    t_s: float
    instrument: str
    true: float
    given: float


class Change(NamedTuple):
    """A command, or a reached state, that is relevant to safety.

    A command is always noted, also without effect; on and off states are noted when they change.

    Attributes:
        t_s: world time.
        instrument: its name.
        what: "control" (of a pressure: "on" or "off"; of a chamber likewise; of a source "off"), "setpoint" (of a
            source, in its unit), "setpoint_psia", "slew_psi_per_s", "vent"
            ("open", "complete", "off"), "setpoint_degC", "door" ("open", "closed"), and of a head "pitch target_deg",
            "pitch reached_deg", "pitch stopped_deg", "pitch stalled_deg"; likewise "roll".
        value: the new value.
    """

    t_s: float
    instrument: str
    what: str
    value: float | str


_STATES = ("on", "off", "closed")


class Tape:
    """Records a simulated bench from now on.

    Args:
        world: virtual time.
        plant: the physical state.
        twins: by instrument.
        heard: called with everything at once, before all others; readings and readbacks are then not kept here.

    Attributes:
        readings: of meters and data-acquisition units, in order.
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
            if "source" in twin.roles:
                plant.source(name).told = told
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
        if self._then != (t0, t1):  # a unit that measures all its inputs at once asks only once for the factors
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
        """Note a change; a future one only if nothing else happens before."""
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
