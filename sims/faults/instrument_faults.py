"""Faults of instruments, and of equipment behind them, that twins of several makers may have.

A twin declares its possible faults; the requirements of a group of kinds on the twin are given at the group. A twin
with a fault of its own declares a `Kind` of its own.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from rig.sims.fault import Kind, Option, Over, Striking
from rig.sims.faults.reading_faults import OPEN_CIRCUIT


def _trip(striking: Striking) -> None:
    axis = striking.fault.word("axis")
    striking.note(f"{axis}: {striking.twin.trip(axis, striking.fault.kind)}")


def _stall(striking: Striking) -> None:
    axis = striking.fault.word("axis")
    striking.plant.head.axes[axis].stall(striking.until)
    striking.note(f"{axis} stalls until {striking.until:.3f} s")


def _slip(striking: Striking) -> None:
    fault = striking.fault
    axis, amount, sees = fault.word("axis"), fault.number("amount_deg"), fault.options["encoder"] == "sees"
    striking.plant.head.axes[axis].slip(amount, encoder=sees)
    also = "and so did its encoder" if sees else "its encoder did not"
    striking.note(f"{axis} jumped by {amount:+g} deg; {also}")


_AXIS = Option("pitch", "", "which axis", ("pitch", "roll"))

OF_HEADS = (
    Kind("drive-fault", "An axis's amplifier fails: it stops, power goes off.", _trip, options={"axis": _AXIS}),
    Kind(
        "following-error",
        "An axis falls behind its set-point: its drive gives up.",
        _trip,
        options={"axis": _AXIS},
    ),
    Kind(
        "stall",
        "An axis stops where it is, and no move gets it going until this is over; its controller says nothing.",
        _stall,
        lasts_s=60.0,
        options={"axis": _AXIS},
    ),
    Kind(
        "slip",
        "The table jumps against its encoder, or both jump together.",
        _slip,
        options={
            "axis": _AXIS,
            "amount_deg": Option(0.05, "deg", "how far", low=-180.0, high=180.0),
            "encoder": Option("blind", "", "whether the encoder moves with the table", ("blind", "sees")),
        },
    ),
)
"""Faults of a head, whose twin moves the plant's head and has `trip(axis, why)`: a drive fails; returns a sentence."""


def _overflow(striking: Striking) -> None:
    striking.twin.overflow_errors()
    striking.note("the error queue ran over")


ERROR_QUEUE = Kind(
    "error-queue-overflow", "The instrument's error queue runs over with errors nobody caused.", _overflow
)
"""Faults of a twin that has `overflow_errors()`."""


def _power_cycle(striking: Striking) -> Over:
    twin, note = striking.twin, striking.note
    assert striking.wire is not None
    twin.power_cycle()
    striking.wire.deafen(striking.until)
    note(f"off until {striking.until:.3f} s")

    def on() -> None:
        twin.power_cycle()
        note("on again")

    return on


POWER = Kind(
    "power-cycle",
    "The instrument goes off and comes on again: it forgets its settings; a head loses its reference.",
    _power_cycle,
    lasts_s=2.0,
)
"""Faults of every instrument; no twin declares them."""


def _lose_source(striking: Striking) -> None:
    fault, source = striking.fault, striking.fault.word("source")
    line = striking.plant.pressure_line(fault.on)
    supply = fault.number("supply_psia") if source == "supply" else None
    line.lose(striking.world.now(), source, striking.until, supply)
    striking.note(f"{source} lost until {striking.until:.3f} s")


SUPPLY = Kind(
    "supply-failure",
    "A pressure source fails: the supply falls, or the vacuum pump lets go to the atmosphere.",
    _lose_source,
    lasts_s=1800.0,
    options={
        "source": Option("supply", "", "which", ("supply", "vacuum")),
        "supply_psia": Option(0.0, "psia", "what the supply falls to", low=0.0),
    },
)
"""Faults of a controller of the plant's pressure line."""


def _alarm(striking: Striking) -> Over:
    twin, state = striking.twin, striking.fault.word("state")
    number = int(striking.fault.number("number"))
    twin.set_alarm(number, state, limit_degC=striking.fault.number("limit_degC"))
    striking.note(f"alarm {number} {state} until {striking.until:.3f} s")
    return partial(twin.set_alarm, number, "none", "off")


def _open_door(striking: Striking) -> Over:
    chamber, world = striking.plant.chamber(striking.fault.on), striking.world
    chamber.open_door(world.now(), striking.fault.number("time_constant_s"))
    striking.note(f"door open until {striking.until:.3f} s")
    return lambda: chamber.close_door(world.now())


def _break_sensor(striking: Striking) -> Over:
    twin = striking.twin
    twin.sensor_broken = True
    striking.note(f"sensor broken until {striking.until:.3f} s")
    return partial(setattr, twin, "sensor_broken", False)


OWN_SENSOR = replace(OPEN_CIRCUIT, act=_break_sensor)
"""The fault of reading faults "open-sensor" for a temperature controller, whose twin has `sensor_broken`."""
ALARM = Kind(
    "chamber-alarm",
    "The temperature controller raises an alarm; it goes on controlling.",
    _alarm,
    lasts_s=600.0,
    options={
        "number": Option(1.0, "", "which alarm", low=1, high=14),
        "state": Option("high", "", "which way", ("high", "low", "error")),
        "limit_degC": Option(60.0, "degC", "the limit that it says was passed"),
    },
)
"""Faults of a temperature controller whose twin has `set_alarm(number, state, kind, limit_degC)`."""
DOOR = Kind(
    "door-open",
    "The chamber's door stands open: it does not control, and its air goes to the laboratory's.",
    _open_door,
    lasts_s=300.0,
    options={"time_constant_s": Option(120.0, "s", "how fast the air goes there", low=1.0)},
)
"""Faults of any controller of one of the plant's chambers."""
