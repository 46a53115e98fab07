"""What must hold after every night, held against the run file and against what truly happened.

Each check reads the file as anybody could and asks the tape; none asks the controller.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

from proving.night import of_commands, of_readings, of_records, of_time
from proving.night.judged import Night, Violation
from proving.night.play import Played
from rig.errors import RunFileError
from rig.run_file.read.reader import RunReader
from rig.run_file.verify.sense import judged

INVARIANTS: Mapping[str, Callable[[Night], Iterator[str]]] = {
    "complete": of_records.complete,
    "accounted": of_records.accounted,
    "truthful": of_readings.truthful,
    "approached": of_readings.approached,
    "one stay": of_readings.one_stay,
    "unbroken": of_time.unbroken,
    "within limits": of_commands.within_limits,
    "safe": of_commands.safe,
    "in order": of_records.in_order,
    "foreseen": of_records.foreseen,
    "left alone": of_commands.left_alone,
    "heeded": of_commands.heeded,
}


UNKNOWABLE: Mapping[str, Callable[[Night], str]] = {"complete": of_records.misread_identity}
"""Rules by which something does not hold since nobody could know it, by the check that finds it."""


def judge(played: Played) -> list[Violation]:
    """Everything that does not hold, empty after a good night; what nobody could know says why."""
    if played.path is None:
        return [Violation("complete", f"no run file after {len(played.sessions)} sessions: {played.sessions[-1]}")]
    try:
        with RunReader.open(played.path) as reader:
            reader.verify()
            senseless = [Violation("verifies", str(finding)) for finding in judged(reader, 1).findings]
            night = Night(played, reader.run_list(), list(reader.records()))
    except RunFileError as error:
        return [Violation("verifies", str(error))]
    found = [(name, what) for name, check in INVARIANTS.items() for what in check(night)]
    whys = {name: UNKNOWABLE[name](night) if name in UNKNOWABLE else "" for name, _ in found}
    return senseless + [Violation(name, what, whys[name]) for name, what in found]
