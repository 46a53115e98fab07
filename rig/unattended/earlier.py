"""How the session before this one ended, as far as the run file tells."""

from __future__ import annotations

from rig.run_file.chain import Record
from rig.run_file.reader import RunReader

_LOOK_BACK = 20


def ended_without_a_word(reader: RunReader) -> bool:
    """Whether the last session was cut off: a power cut, a crash, a kill. False where there was none."""
    count, _ = reader.head()
    rows = reader.chained("seq > ?", (count - _LOOK_BACK,))
    for _, record, _, _ in reversed(list(rows)):
        if _is_last_word(record):
            return False
        if record.kind not in ("event", "fault"):
            break
    return True


def _is_last_word(record: Record) -> bool:
    return (
        record.kind in ("run", "stop", "end")
        or (record.kind == "fault" and record.status == "abort")
        or (record.kind == "event" and record.status in ("interrupted", "parked"))
    )
