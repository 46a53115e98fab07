"""Unattended operation: checks before a run, logs, messages to people, the service manager.

None of them can end a run.
"""

from rig.unattended.happenings import Happening, Kind, RunFacts
from rig.unattended.listeners import Listeners
from rig.unattended.logs import Log
from rig.unattended.manager import ServiceManager

__all__ = ["Happening", "Kind", "Listeners", "Log", "RunFacts", "ServiceManager"]
