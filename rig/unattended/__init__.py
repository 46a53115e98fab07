"""Unattended life: what keeps a night going without anybody, and who is told of it.

The log, notifications, the service manager, the evening's doctor. None of it can end a run.
"""

from rig.unattended.happenings import Happening, Kind, RunFacts
from rig.unattended.listeners import Listeners
from rig.unattended.logs import Log
from rig.unattended.manager import ServiceManager

__all__ = ["Happening", "Kind", "Listeners", "Log", "RunFacts", "ServiceManager"]
