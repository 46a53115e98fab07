"""Faults of a simulated bench: the [[faults]] of a world file (docs/reference/simulation.md)."""

from rig.sims.fault import Fault, Kind, Option, Striking
from rig.sims.faults.faulty_wire import FaultyWire
from rig.sims.faults.known_kinds import COMMON, kinds_of, kinds_on
from rig.sims.faults.schedule import Faults, Happening
from rig.sims.faults.world_file import read_faults

__all__ = [
    "COMMON",
    "Fault",
    "Faults",
    "FaultyWire",
    "Happening",
    "Kind",
    "Option",
    "Striking",
    "kinds_of",
    "kinds_on",
    "read_faults",
]
