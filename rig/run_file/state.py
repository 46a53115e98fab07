"""The state of a run, folded from its records. Nothing else remembers anything."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field
from math import inf
from typing import Any, NamedTuple

from rig.run_file.bodies import ContentsError
from rig.run_file.chain import Record
from rig.run_file.indexes import IndexCounts, IndexSet
from rig.run_file.opening import makes_no_sense
from rig.run_file.reader import RunReader
from rig.who import told

_FAULTS_KEPT = 20


class Trouble(NamedTuple):
    """One fault and what was decided about it."""

    elapsed_s: float
    point: int | None
    message: str
    decision: str


@dataclass
class RunState:
    """What a run has come to.

    Attributes:
        points: length of the run list.
        sessions: how often a controller has been started on it.
        accepted: indexes of points with an accepted observation.
        prepared: whether set-up, homing and environment have been completed since they were last found wanting.
        worked_s: elapsed time of the last observation or completed preparation; None before the first.
        rested: how the last session ended: "interrupted" (nothing was said), "stopped" or "faulted".
        skipped: index to reason, for points given up for good.
        put_off: indexes of points that were skipped once, to be tried again at the end.
        attempts: index to number of attempts so far.
        elapsed_s: of the last record.
        utc_s: of the last record.
        latest_zero_s: UTC at which elapsed time was zero, by the session whose clock was ahead of all others'.
        identities: who the instruments were, by name, as last accepted.
        operators: who ran the sessions, each once, as far as they say.
        session: body of the last session record: boot id, clock reading and the elapsed time that went with it.
        last_index: the point last observed.
        whole_plot: identity of the whole plot that is open, or was last; None before the first and after one was lost.
        planned: which planned whole plot it is a measurement of.
        whole_plots: identities given so far.
        left_for: the planned whole plot for which temperatures have been left since the last was measured.
        lost: identity to reason, for whole plots that were given up and measured again.
        decisions: how often each decision was taken about each class of fault ("no_reply: retry").
        faults: the last of them, for people.
        safe: how the bench was last brought to its safe state: body of that event.
        ended: status of the end record, None while the run can be resumed.
        rescued: the copy in which the run goes on since this file lost its name; "" if it goes on here.
        simulated: no real instrument involved.

    """

    points: int = 0
    sessions: int = 0
    accepted: IndexSet = field(default_factory=IndexSet)
    prepared: bool = False
    worked_s: float | None = None
    rested: str = "created"
    skipped: dict[int, str] = field(default_factory=dict)
    put_off: IndexSet = field(default_factory=IndexSet)
    attempts: IndexCounts = field(default_factory=IndexCounts)
    elapsed_s: float = 0.0
    utc_s: float = 0.0
    latest_zero_s: float = -inf
    identities: dict[str, dict[str, Any]] = field(default_factory=dict)
    operators: list[str] = field(default_factory=list)
    session: dict[str, Any] = field(default_factory=dict)
    last_index: int | None = None
    whole_plot: int | None = None
    planned: int | None = None
    whole_plots: int = 0
    left_for: int | None = None
    lost: dict[int, str] = field(default_factory=dict)
    decisions: dict[str, int] = field(default_factory=dict)
    faults: deque[Trouble] = field(default_factory=lambda: deque(maxlen=_FAULTS_KEPT))
    safe: dict[str, Any] = field(default_factory=dict)
    ended: str | None = None
    rescued: str = ""
    simulated: bool = False
    run_id: str = ""
    last_fault: str | None = None

    @property
    def remaining(self) -> int:
        """Points still to be observed."""
        return self.points - len(self.accepted) - len(self.skipped)

    def add(self, record: Record) -> None:
        """Take one more record, in order."""
        _, kind, self.elapsed_s, self.utc_s, index, _, attempt, status, _ = record
        match kind:
            case "observation":
                assert index is not None
                self.attempts[index] = attempt or 1
                if status == "accepted":
                    self.worked_s = self.elapsed_s
                    self.accepted.add(index)
                    self.last_index = index
            case "run":
                self.points = int(record.data["points"])
                self.simulated = bool(record.data["simulated"])
                self.run_id = str(record.data["run_id"])
            case "session":
                self.sessions = record.session
                self.latest_zero_s = max(self.latest_zero_s, record.utc_s - record.elapsed_s)
                self.session = record.data
                if (by := told(record.data)) and by not in self.operators:
                    self.operators.append(by)
                self.last_fault = None
                self.rested = "interrupted"
                self.rescued = ""
            case "event":
                self._add_event(record)
            case "stop":
                self.rested = "stopped"
            case "identity":
                self.identities[str(record.status)] = record.data
            case "skip":
                assert record.run_index is not None
                self.attempts[record.run_index] = record.attempt or 1
                self.put_off.add(record.run_index)
                if record.status == "final":
                    self.skipped[record.run_index] = str(record.data["reason"])
            case "fault":
                if record.run_index is not None:
                    self.attempts[record.run_index] = record.attempt or 1
                self.last_fault = str(record.data["message"])
                decision = f"{record.data.get('fault', 'fault')}: {record.status}"
                self.decisions[decision] = self.decisions.get(decision, 0) + 1
                self.faults.append(Trouble(record.elapsed_s, record.run_index, self.last_fault, decision))
                if record.status == "abort":
                    self.rested = "faulted"
            case "end":
                self.ended = record.status
            case _:
                pass

    def _add_event(self, record: Record) -> None:
        match record.status:
            case "preparing" | "prepared":
                self.prepared = record.status == "prepared"
                self.worked_s = record.elapsed_s if self.prepared else self.worked_s
            case "whole-plot":
                self.whole_plot, self.planned = record.whole_plot, int(record.data["planned"])
                self.whole_plots = record.whole_plot or 0
                self.left_for = None
                self.worked_s = record.elapsed_s
            case "safe":
                self.safe = record.data
            case "rescued":
                self.rescued = str(record.data["to"])
            case "temperatures-left":
                self.left_for = int(record.data["planned"])
            case "whole-plot-lost":
                self._lose_whole_plot(record)
            case _:
                pass

    def _lose_whole_plot(self, record: Record) -> None:
        """Its points are to be observed again; what was accepted stays data of the identity that was lost."""
        first, count = int(record.data["first"]), int(record.data["count"])
        again = range(first, first + count)
        self.accepted.difference_update(again)
        self.put_off.difference_update(again)
        for index in again:
            self.skipped.pop(index, None)
        assert record.whole_plot is not None
        self.lost[record.whole_plot] = str(record.data["reason"])
        self.whole_plot = self.planned = None


def fold(records: Iterable[Record]) -> RunState:
    """State after all of `records`."""
    state = RunState()
    for record in records:
        state.add(record)
    return state


def read_state(reader: RunReader) -> RunState:
    """State of a run file; one whose contents make no sense is said to be damaged or edited, and where.

    Raises:
        RunFileError: the file does not verify, or its records make no sense together.

    """
    try:
        return fold(reader.records())
    except ContentsError as error:
        reader.verify()
        raise makes_no_sense(reader.path, error) from error


def is_simulated(reader: RunReader) -> bool:
    """Whether a run involves no real instrument, without reading all of it. Raises `RunFileError` as `read_state`."""
    try:
        return bool(reader.genesis().data["simulated"])
    except ContentsError:
        return read_state(reader).simulated
