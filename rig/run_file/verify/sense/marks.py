"""Consistency of faults, rejections, skips and attempts: each must be explained by the others."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from rig.run_file.chain import Record
from rig.run_file.events.bench import Fault, MadeSafe, Recovered
from rig.run_file.events.event import Event
from rig.run_file.events.points import CONTRADICTORY, MISSING, OVERSHOT, Observed, Skipped, WholePlotLost
from rig.run_file.events.sessions import Ended, Hole, SessionBegan
from rig.run_file.state.indexes import IndexCounts
from rig.run_file.state.state import RunState
from rig.run_file.verify.sense.recorded_run import NOTED, RecordedRun

_AT_POINT = ("recovering", "moving", "settling", "measuring", "recording")
"""States in which a failure is counted at the current point."""
_OF_THE_RUN = "temperature_left"
"""Class of fault that is counted over the whole session."""
_FLAGS = {"noisy", "frozen", "temperature", "reference", CONTRADICTORY, MISSING, OVERSHOT}
_SKIP, _MEASURING, _OVERLOAD = "skip", "measuring", "overload"


class Marks:
    """Checks that the records required before another record are present.

    Args:
        case: the run.

    """

    def __init__(self, case: RecordedRun) -> None:
        self._case = case
        self._caused = IndexCounts()
        self._before: tuple[Record, Event] | None = None
        self._writes_all = False
        self._failures: dict[str, dict[str, int]] = {}

    def look(self, record: Record, event: Event, _fold: RunState) -> Iterator[str]:
        """Defects of a record: ends of sentences that begin with the record's name."""
        if isinstance(event, NOTED):
            return
        yield from self._attempt(record, event)
        before, self._before = self._before, (record, event)
        if before is not None and not isinstance(event, SessionBegan):
            yield from _follows(record, event, *before)
            if (
                isinstance(event, Ended)
                and self._writes_all
                and not (isinstance(before[1], MadeSafe) and not before[1].unsafe)
            ):
                yield "nothing says that the bench was brought to its safe state before it"
        match event:
            case SessionBegan():
                self._failures.clear()
                self._writes_all = event.writes_all
            case Fault():
                yield from self._fault(record, event)
            case Skipped():
                self._failures.pop(f"point {record.run_index}", None)
            case Recovered():
                found = self._failures.pop(event.place, {})
                if found != event.failures:
                    yield f"{event.place} recovered from {_counts(event.failures)}, and there were {_counts(found)}"
            case Observed():
                flags = set(event.flags) - _FLAGS
                if (OVERSHOT in event.flags) != any(OVERSHOT in one for one in event.steered.values()):
                    yield "its flag and its settings differ about whether one went beyond the level"
                if flags:
                    yield f"it is marked as {', '.join(sorted(map(str, flags)))}, which no controller does"

    def _attempt(self, record: Record, event: Event) -> Iterator[str]:
        """Check that every attempt after the first follows a record that ended the previous one."""
        index, attempt = record.run_index, record.attempt
        if index is None or attempt is None:
            return
        caused = self._caused.get(index, 0)
        if attempt > caused + 1:
            yield f"it is attempt {attempt} at the point, and nothing says how attempt {caused + 1} ended"
        if isinstance(event, Observed | Skipped | Fault | Hole) and attempt > caused:
            self._caused[index] = attempt

    def _fault(self, record: Record, event: Fault) -> Iterator[str]:
        fault, failure = event.fault or "", event.failure
        if failure is None:
            return
        at_point = record.run_index is not None and event.where in _AT_POINT
        place = f"point {record.run_index}" if at_point else str(event.where)
        counts = self._failures.setdefault("run" if fault == _OF_THE_RUN else place, {})
        told = counts.get(fault, 0)
        counts[fault] = failure
        if failure > 1 and failure != told + 1:
            yield f"it is failure {failure} of its class ({fault}) at {place}, and {told} were told before"


def _follows(record: Record, event: Event, before: Record, was: Event) -> Iterator[str]:
    """Check records that must be consecutive."""
    same_point = record.run_index == before.run_index
    overloaded = isinstance(was, Observed) and was.overload is not None
    if isinstance(was, Observed) and not was.accepted:
        lost = isinstance(event, WholePlotLost) and record.whole_plot == before.whole_plot
        if was.lost is not None and not lost:
            yield "it follows an observation of a whole plot that was lost, and the loss is missing"
        if overloaded and not (isinstance(event, Fault) and same_point) and record.kind != Event.kind:
            yield "it follows an observation that was out of range, and the fault is missing"
        if was.lost is None and was.hole_s is None and not overloaded:
            yield "it follows an observation that was rejected for no reason"
    if isinstance(event, Observed) and event.hole_s is not None and not event.accepted and not isinstance(was, Hole):
        yield "it was rejected for a hole in time, which is missing"
    skipping = isinstance(was, Fault) and was.decision == _SKIP and same_point
    if isinstance(event, Skipped) and not skipping:
        yield "it is skipped, and the fault that it was skipped for is missing"
    elif skipping and not isinstance(event, Skipped) and record.kind != Event.kind:
        yield "it follows a fault for which its point was to be skipped, and the skip is missing"
    told = isinstance(event, Fault) and event.where == _MEASURING and event.fault == _OVERLOAD
    if told and not (overloaded and same_point):
        yield "it says that readings were out of range, and they are missing"


def _counts(failures: Mapping[str, int]) -> str:
    return ", ".join(f"{fault.replace('_', ' ')} {n}x" for fault, n in failures.items()) or "nothing"
