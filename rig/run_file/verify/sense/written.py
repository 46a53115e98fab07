"""Whether a controller of this version writes such records: known kinds, complete fields, possible order."""

from __future__ import annotations

from collections.abc import Iterator

from rig.run_file.chain import Record
from rig.run_file.events.bench import Fault, MadeSafe, Prepared, Preparing
from rig.run_file.events.event import Event, Unknown
from rig.run_file.events.points import Observed, WholePlotLost
from rig.run_file.events.sessions import Ended, Held, Released, SessionBegan
from rig.run_file.state.state import RunState
from rig.run_file.verify.sense.recorded_run import NOTED, RecordedRun
from rig.version import VERSION

_RIG = "calibration-rig"
_DECISIONS = {"retry", "re-home", "re-soak", "skip", "hold", "abort", "leave"}
_HOLD = "hold"
_OF_A_FAULT = ("error", "where", "failure", "number", "pause_s")
"""Fields of a fault that a policy decided about."""
_LEFT = "temperature_left"
_DOUBTED = " readings are in doubt and left out)"


def other_version(case: RecordedRun) -> Iterator[str]:
    """Remark on checks against the stored procedure that were left out because another version of rig began the run."""
    said = case.about.software.get(_RIG, "none")
    if said == VERSION or case.procedure is None:
        return
    if case.procedure.expand().sha256() != case.run_list.sha256():
        yield (
            f"its first record says that version {said} of rig began it, and this is {VERSION}, which makes "
            f"another run list of its procedure: nothing tells whether the run list is that version's"
        )


class Written:
    """Finds records that no controller of this version writes.

    Args:
        case: the run.

    """

    def __init__(self, case: RecordedRun) -> None:
        self._case = case
        self._ours = self._writes_all = False
        self._held = self._preparing = False
        self._safe = False
        self._lost: WholePlotLost | None = None
        self._unheld: dict[str, int] = {}

    @property
    def doubts(self) -> list[str]:
        """Remarks on checks that were left out because a session is by another version."""
        return [
            f"session {first} is said to be {what}: its records were not held against all that this version writes"
            for what, first in self._unheld.items()
        ]

    def look(self, record: Record, event: Event, _fold: RunState) -> Iterator[str]:
        """Defects of a record: ends of sentences that begin with the record's name."""
        if isinstance(event, SessionBegan):
            self._ours = event.software.get(_RIG) == VERSION
            self._writes_all = event.writes_all
            if not (self._ours and self._writes_all):
                said = f"of version {event.software.get(_RIG, 'none')} of rig" if not self._ours else "an early one's"
                self._unheld.setdefault(said, record.session)
            self._held = self._preparing = self._safe = False
            self._lost = None
        if self._ours and isinstance(event, Unknown):
            yield f"it is a {event.sort}, which no controller of its version ({VERSION}) writes"
        if self._ours and self._writes_all:
            yield from self._fields(record, event)
        yield from self._order(event)

    def _fields(self, record: Record, event: Event) -> Iterator[str]:
        match event:
            case Observed():
                missing = [] if event.measured_s or event.overload is not None else ["measured_s"]
                if record.attempt is None:
                    yield "it does not say which attempt at its point it is"
            case Fault():
                missing = [name for name in _OF_A_FAULT if event.fault is not None and getattr(event, name) is None]
                if event.decision not in _DECISIONS:
                    yield f"its decision is {event.decision}, which no controller takes"
            case Ended():
                wanted = ["accepted", "skipped", *(() if self._case.soak is None else ("lost", "whole_plots"))]
                missing = [name for name in wanted if name not in record.data]
                if event.how != "complete":
                    yield f"a run ends as complete, not as {event.how}"
            case _:
                missing = sorted(event.body().keys() - record.data.keys())
        if missing:
            yield f"its body has no {', '.join(missing)}, which every controller writes"

    def _order(self, event: Event) -> Iterator[str]:
        if isinstance(event, NOTED):
            return
        lost, self._lost = self._lost, None
        match event:
            case Held():
                self._held = True
            case Released():
                if not self._held:
                    yield "nothing was held that it could release"
                self._held = False
            case Preparing():
                self._preparing = True
            case Prepared():
                if not self._preparing:
                    yield "nothing says that preparing began"
                self._preparing = False
            case MadeSafe():
                self._safe = True
            case Observed():
                if self._safe:
                    yield "it was made after its session had brought the bench to its safe state"
            case WholePlotLost():
                self._lost = event
            case Fault():
                self._held |= event.decision == _HOLD
                why = "" if lost is None else lost.reason
                stem = why.rpartition(" (")[0] if why.endswith(_DOUBTED) else why
                if event.fault == _LEFT and stem not in event.message:
                    yield f"it tells another reason for which the whole plot was lost than is said before it: {stem}"
