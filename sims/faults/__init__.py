"""What goes wrong on a simulated bench, and when: the [[faults]] of a world file (docs/faults.md)."""

from sims.faults.fault import Fault, read_faults
from sims.faults.instruments import Acts
from sims.faults.kinds import KINDS, Kind, Option
from sims.faults.schedule import Faults, Happening
from sims.faults.wire import FaultyWire

__all__ = ["KINDS", "Acts", "Fault", "Faults", "FaultyWire", "Happening", "Kind", "Option", "read_faults"]
