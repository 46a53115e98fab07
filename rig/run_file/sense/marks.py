"""Whether faults, rejections, skips and attempts explain one another."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from rig.run_file.chain import Record
from rig.run_file.indexes import IndexCounts
from rig.run_file.sense.case import NOTED, Case
from rig.run_file.state import RunState

_AT_POINT = ("recovering", "moving", "settling", "measuring", "recording")
"""States in which a failure is counted at the point in hand."""
_OF_THE_RUN = "temperature_left"
"""The class of fault that is counted over the whole session."""
_FLAGS = {"noisy", "frozen", "temperature"}


class Marks:
    """Looks at what should have been written down before something else.

    Args:
        case: the run.

    """

    def __init__(self, case: Case) -> None:
        self._case = case
        self._caused = IndexCounts()
        self._before: tuple[Record, Mapping[str, Any]] | None = None
        self._failures: dict[str, dict[str, int]] = {}

    def look(self, record: Record, data: Mapping[str, Any], _fold: RunState) -> Iterator[str]:
        """See `Rule.look`."""
        if record.kind == "event" and record.status in NOTED:
            return
        yield from self._attempt(record)
        before, self._before = self._before, (record, data)
        if before is not None and record.kind != "session":
            yield from _follows(record, data, *before)
        match record.kind:
            case "session":
                self._failures.clear()
            case "fault":
                yield from self._fault(record, data)
            case "skip":
                self._failures.pop(f"point {record.run_index}", None)
            case "event" if record.status == "recovered":
                found = self._failures.pop(data["place"], {})
                if found != data["failures"]:
                    yield f"{data['place']} recovered from {_counts(data['failures'])}, and there were {_counts(found)}"
            case "observation":
                flags = set(data.get("flags", ())) - _FLAGS
                if flags:
                    yield f"it is marked as {', '.join(sorted(map(str, flags)))}, which no controller does"

    def _attempt(self, record: Record) -> Iterator[str]:
        """Every attempt at a point but the first follows something that made the one before end."""
        index, attempt = record.run_index, record.attempt
        if index is None or attempt is None:
            return
        caused = self._caused.get(index, 0)
        if attempt > caused + 1:
            yield f"it is attempt {attempt} at the point, and nothing says how attempt {caused + 1} ended"
        ends = record.kind in ("observation", "skip", "fault") or record.status == "hole"
        if ends and attempt > caused:
            self._caused[index] = attempt

    def _fault(self, record: Record, data: Mapping[str, Any]) -> Iterator[str]:
        if "failure" not in data:
            return
        fault, failure = data["fault"], data["failure"]
        at_point = record.run_index is not None and data["where"] in _AT_POINT
        place = f"point {record.run_index}" if at_point else data["where"]
        counts = self._failures.setdefault("run" if fault == _OF_THE_RUN else place, {})
        told = counts.get(fault, 0)
        counts[fault] = failure
        if failure > 1 and failure != told + 1:
            yield f"it is failure {failure} of its class ({fault}) at {place}, and {told} were told before"


def _follows(record: Record, data: Mapping[str, Any], before: Record, was: Mapping[str, Any]) -> Iterator[str]:
    """What was written directly after one another belongs together."""
    same_point = record.run_index == before.run_index
    if before.kind == "observation" and before.status == "rejected":
        lost = record.status == "whole-plot-lost" and record.whole_plot == before.whole_plot
        if "lost" in was and not lost:
            yield "it follows an observation of a whole plot that was lost, and the loss is missing"
        if "overload" in was and not (record.kind == "fault" and same_point) and record.kind != "event":
            yield "it follows an observation that was out of range, and the fault is missing"
        if not {"lost", "overload", "hole_s"} & was.keys():
            yield "it follows an observation that was rejected for no reason"
    if record.kind == "observation" and record.status == "rejected" and "hole_s" in data and before.status != "hole":
        yield "it was rejected for a hole in time, which is missing"
    skipping = before.kind == "fault" and before.status == "skip" and same_point
    if record.kind == "skip" and not skipping:
        yield "it is skipped, and the fault that it was skipped for is missing"
    elif skipping and record.kind not in ("skip", "event"):
        yield "it follows a fault for which its point was to be skipped, and the skip is missing"
    if record.kind == "end" and (before.status != "safe" or was["unsafe"]):
        yield "nothing says that the bench was brought to its safe state before it"
    measured = record.kind == "fault" and data.get("where") == "measuring"
    if measured and data.get("fault") == "overload" and not ("overload" in was and same_point):
        yield "it says that readings were out of range, and they are missing"


def _counts(failures: Mapping[str, int]) -> str:
    return ", ".join(f"{fault.replace('_', ' ')} {n}x" for fault, n in failures.items()) or "nothing"
