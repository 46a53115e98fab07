"""What truly happened on a simulated bench, for checkers that know nothing of drivers: readings and commands.

Nothing in a run reads it. A checker asks what a sensor truly gave at a moment, whatever was said on a wire.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any, NamedTuple

from sims.faults.kinds import HEADS
from sims.physics import Plant
from sims.physics.told import Told
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
        given: the number made of it; an overload is 9.9e37, on the data-acquisition unit anything beyond its range.
        factors: what was true in the middle of the window: pitch_deg and roll_deg of the table, or pressure_psia at
            the transducers (mean over the window), and sensor_temperature_degC, sse_temperature_degC.

    """

    t_s: float
    end_s: float
    instrument: str
    channel: str
    unit: str
    true: float
    given: float
    factors: Mapping[str, float]


class Change(NamedTuple):
    """Something that safety depends on was commanded, or reached.

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


class Tape:
    """Listens to a simulated bench from now on.

    Args:
        world: virtual time.
        plant: what is there.
        twins: by instrument.
        drivers: driver by instrument.

    Attributes:
        readings: of meters and data-acquisition units, in the order in which they were made.
        changes: in order.

    """

    def __init__(self, world: World, plant: Plant, twins: Mapping[str, Any], drivers: Mapping[str, str]) -> None:
        self.readings: list[Reading] = []
        self.changes: list[Change] = []
        self._world = world
        self._plant = plant
        self._last: dict[tuple[str, str], float | str] = {}
        for name, twin in twins.items():
            told = partial(self._change, name)
            if drivers[name] == "druck-pace":
                plant.pressure_line(name).told = told
            elif drivers[name] == "watlow-f4t":
                plant.chamber(name).told = told
            elif drivers[name] in HEADS:
                for axis, mechanics in plant.head.axes.items():
                    mechanics.told = self._axis(name, axis)
            elif hasattr(twin, "inputs"):
                twin.inputs.heard = partial(self._reading, name)

    def _reading(self, instrument: str, channel: str, unit: str, t0: float, t1: float, given: float) -> None:
        plant = self._plant
        if unit == "V":
            true = plant.clean_V(instrument, channel, t0, t1)
        else:
            true = plant.channel_degC(instrument, channel, (t0 + t1) / 2.0)
        self.readings.append(Reading(t0, t1, instrument, channel, unit, true, given, plant.factors(t0, t1)))

    def _change(self, instrument: str, what: str, value: float | str, after_s: float = 0.0) -> None:
        """Note a change; one that is still to come only if nothing else happens to it before."""
        if after_s > 0.0:
            count, subject = len(self.changes), what.partition(" ")[0]

            def due() -> None:
                since = self.changes[count:]
                if not any(c.instrument == instrument and c.what.partition(" ")[0] == subject for c in since):
                    self._change(instrument, what, value)

            self._world.call_in(after_s, due)
        elif self._last.get((instrument, what)) != value or what.endswith("_deg"):
            self._last[instrument, what] = value
            self.changes.append(Change(self._world.now(), instrument, what, value))

    def _axis(self, name: str, axis: str) -> Told:
        def told(what: str, value: float | str, after_s: float = 0.0, /) -> None:
            self._change(name, f"{axis} {what}", value, after_s)

        return told
