"""How the previous session ended, by the run file."""

from __future__ import annotations

from rig.run_file.events.bench import Fault
from rig.run_file.events.corrections import Corrected
from rig.run_file.events.event import Event
from rig.run_file.events.points import Observed
from rig.run_file.events.sessions import Parked, RunCreated
from rig.run_file.read.reader import RunReader

_LOOK_BACK = 20


def ended_without_a_word(reader: RunReader) -> bool:
    """Whether the last session ended without a record: a power cut, a crash, a kill. False if there was none."""
    count, _ = reader.head()
    rows = reader.chained("seq > ?", (count - _LOOK_BACK,))
    for _, record, _, _ in reversed(list(rows)):
        if record.kind == Observed.kind:
            return True
        if record.kind == Corrected.kind:  # by a person, after the session
            continue
        if isinstance(record.event, RunCreated | Parked) or record.event.ending:
            return False
        if record.kind not in (Event.kind, Fault.kind):
            break
    return True
