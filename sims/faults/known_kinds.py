"""The existing kinds of faults: the common ones, and those declared by the twins of a bench."""

from __future__ import annotations

from collections.abc import Iterable

from rig.sims.fault import Kind
from rig.sims.faults.clock_faults import OF_THE_BENCH
from rig.sims.faults.instrument_faults import ALARM, DOOR, ERROR_QUEUE, OF_HEADS, POWER, SUPPLY
from rig.sims.faults.reading_faults import OF_READINGS
from rig.sims.faults.wire_faults import OF_WIRES
from rig.sims.twin import TwinClass

COMMON: tuple[Kind, ...] = (
    *OF_WIRES,
    *OF_HEADS,
    *OF_READINGS,
    ERROR_QUEUE,
    POWER,
    SUPPLY,
    ALARM,
    DOOR,
    *OF_THE_BENCH,
)
"""Kinds that do not concern one instrument alone. Random nights draw them in this order."""


def kinds_of(twin: TwinClass) -> dict[str, Kind]:
    """Possible faults of an instrument, by name: faults of its wire, of its power, and those declared by its twin."""
    of_wire = (kind for kind in OF_WIRES if twin.wire in kind.wires)
    return {kind.name: kind for kind in (*of_wire, POWER, *twin.faults)}


def kinds_on(twins: Iterable[TwinClass]) -> dict[str, Kind]:
    """The common kinds and those of a bench's twins, by name."""
    own = (kind for twin in twins for kind in twin.faults)
    return {kind.name: kind for kind in (*COMMON, *own)}
