"""The state of a run, folded from its records. There is no other source of state."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field
from math import inf
from typing import Any

from rig.procedures.plan.hand_steps import HandStep, undone
from rig.run_file.bodies import ContentsError
from rig.run_file.chain import Record
from rig.run_file.events.bench import Fault, Learned, MadeSafe, Prepared, Preparing, Warned
from rig.run_file.events.by_hand import DoneByHand, ReadByHand, SetByHand
from rig.run_file.events.corrections import Corrected
from rig.run_file.events.event import Event
from rig.run_file.events.points import ACCEPTED, Observed, Skipped, TemperaturesLeft, WholePlotBegan, WholePlotLost
from rig.run_file.events.sessions import Ended, Identified, Interruption, Rescued, RunCreated, SessionBegan, Stopped
from rig.run_file.read.reader import RunReader
from rig.run_file.read.safe_opening import makes_no_sense
from rig.run_file.state.indexes import IndexCounts, IndexSet

_FAULTS_KEPT = 20
MOST_LOST = 0.1
"""Share of its points that a complete run may have lost and still end in 0."""


@dataclass
class RunState:
    """The state of a run.

    Attributes:
        points: length of the run list.
        sessions: number of starts of a controller.
        accepted: indexes of points with an accepted observation.
        prepared: whether set-up, homing and environment are complete, and have not been found incomplete since.
        worked_s: elapsed time of the last observation or completed preparation; None before the first.
        rested: how the last session ended: "interrupted" (without a record), "stopped" or "faulted".
        skipped: index to reason, for points given up for good.
        put_off: indexes of postponed points, to be tried again at the end.
        attempts: index to number of attempts so far.
        elapsed_s: elapsed time of the last record.
        utc_s: UTC of the last record.
        latest_zero_s: UTC at which elapsed time was zero, by the session with the latest such value.
        identities: last accepted identities of the instruments, by name.
        operators: known operators of the sessions, each once.
        session: start of the last session: boot id, clock reading and elapsed time.
        last_index: index of the last observed point.
        whole_plot: identity of the open or last whole plot; None before the first and after a loss.
        planned: number of its planned whole plot.
        whole_plots: number of identities given so far.
        left_for: the planned whole plot for which temperatures have been left since the last was measured.
        lost: identity to reason, for whole plots that were given up and measured again.
        kept: accepted readings of these that tables have.
        by_hand: steps that a person has done, by ordinal from 1.
        set_by_hand: last setting of each factor that a person set.
        typed: by point and column, what was typed since the last observation of the point, in the typed units.
        corrected: corrections of typed entries, a sentence each. They are no part of the run's time.
        steps: number of the steps of the run list.
        doubted: indexes of points whose accepted observation is doubted.
        learned: what readers have learned of their instruments, by name.
        decisions: number of decisions, by class of fault and decision ("no_reply: retry").
        faults: records of the last faults, for people.
        safe: body of the last event of bringing the bench to its safe state.
        left_on: outputs that the last session left on, with their values; empty after a safe state.
        ended: status of the end record, None while the run can be resumed.
        rescued: the rescued copy in which the run continues; "" if it continues here.
        simulated: whether no real instrument is involved.

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
    session: SessionBegan | None = None
    last_index: int | None = None
    whole_plot: int | None = None
    planned: int | None = None
    whole_plots: int = 0
    left_for: int | None = None
    lost: dict[int, str] = field(default_factory=dict)
    kept: int = 0
    by_hand: dict[int, DoneByHand] = field(default_factory=dict)
    set_by_hand: dict[str, SetByHand] = field(default_factory=dict)
    typed: dict[int, dict[str, list[float]]] = field(default_factory=dict)
    corrected: list[str] = field(default_factory=list)
    steps: int = 0
    doubted: IndexSet = field(default_factory=IndexSet)
    learned: dict[str, dict[str, Any]] = field(default_factory=dict)
    decisions: dict[str, int] = field(default_factory=dict)
    faults: deque[Record] = field(default_factory=lambda: deque(maxlen=_FAULTS_KEPT))
    safe: dict[str, Any] = field(default_factory=dict)
    left_on: list[str] = field(default_factory=list)
    ended: str | None = None
    rescued: str = ""
    simulated: bool = False
    run_id: str = ""
    last_fault: str | None = None
    _by_hand: tuple[HandStep, ...] = ()

    @property
    def unsafe(self) -> list[str]:
        """Instruments that the last session left without their safe state, one sentence each."""
        return [str(words) for words in self.safe.get("unsafe") or ()]

    @property
    def remaining(self) -> int:
        """Points still to be observed."""
        return self.points - len(self.accepted) - len(self.skipped)

    @property
    def too_few(self) -> bool:
        """Whether it has lost more points than a run that ends in 0 may."""
        return len(self.skipped) > MOST_LOST * self.points

    def add(self, record: Record) -> None:
        """Take the next record."""
        if record.kind == Corrected.kind:
            self.corrected.append(record.sentence())
            return
        _, kind, self.elapsed_s, self.utc_s, index, _, attempt, status, _ = record
        if kind == Observed.kind:  # nearly all records; the body is not needed
            assert index is not None
            self.attempts[index] = attempt or 1
            if self.typed:
                self.typed.pop(index, None)
            if status == ACCEPTED:
                self.worked_s = self.elapsed_s
                self.accepted.add(index)
                self.last_index = index
        else:
            self._happened(record, record.event)

    def _happened(self, record: Record, event: Event) -> None:
        match event:
            case RunCreated():
                self.points, self.simulated, self.run_id = event.points, event.simulated, event.run_id
                self._by_hand = event.steps
                self.steps = len(event.steps)
            case DoneByHand() | SetByHand() | ReadByHand():
                self._done_by_hand(record, event)
            case SessionBegan():
                self.sessions = record.session
                self.latest_zero_s = max(self.latest_zero_s, record.utc_s - record.elapsed_s)
                self.session = event
                if event.by and event.by not in self.operators:
                    self.operators.append(event.by)
                self.last_fault, self.left_on, self.safe = None, [], {}
                self.rested = "interrupted"
                self.rescued = ""
            case Preparing():
                self.prepared = False
            case Prepared():
                self.prepared = True
                self.worked_s = record.elapsed_s
            case MadeSafe():
                self.safe = record.data
            case Warned() if event.doubted is not None:
                self.doubted.add(event.doubted)
            case Learned():
                self.learned[event.instrument] = dict(event.learned)
            case Interruption():
                self.left_on = [*event.left_on]
                if event.unsafe:
                    self.rested = "faulted"
                    self.last_fault = "; ".join(event.unsafe)
            case Rescued():
                self.rescued = event.to
            case Stopped():
                self.rested = "stopped"
            case Identified():
                self.identities[event.instrument] = event.body()
            case Ended():
                self.ended = event.how
            case Skipped() | Fault():
                self._failed(record, event)
            case TemperaturesLeft() | WholePlotBegan() | WholePlotLost():
                self._whole_plot(record, event)
            case _:
                pass

    def _done_by_hand(self, record: Record, event: DoneByHand | SetByHand | ReadByHand) -> None:
        match event:
            case DoneByHand():
                self.by_hand[event.step] = event
            case SetByHand():
                self.set_by_hand[event.factor] = event
            case _ if record.run_index is not None:
                readings = self.typed.setdefault(record.run_index, {}).setdefault(event.column, [])
                readings[max(event.number - 1, 0) :] = [event.typed]

    def _failed(self, record: Record, event: Skipped | Fault) -> None:
        index = record.run_index
        if index is not None:
            self.attempts[index] = record.attempt or 1
        if isinstance(event, Skipped):
            assert index is not None
            self.typed.pop(index, None)
            self.put_off.add(index)
            if event.final:
                self.skipped[index] = event.reason
            return
        self.last_fault = event.message
        self.decisions[event.decided] = self.decisions.get(event.decided, 0) + 1
        self.faults.append(record)
        if event.gives_up:
            self.rested = "faulted"

    def _whole_plot(self, record: Record, event: TemperaturesLeft | WholePlotBegan | WholePlotLost) -> None:
        """Note a lost whole plot: its points are observed again; accepted readings remain data of its identity."""
        match event:
            case TemperaturesLeft():
                self.left_for = event.planned
            case WholePlotBegan():
                self.whole_plot, self.planned = record.whole_plot, event.planned
                self.whole_plots = record.whole_plot or 0
                self.left_for = None
                self.worked_s = record.elapsed_s
            case WholePlotLost():
                self.accepted.difference_update(event.points)
                self.put_off.difference_update(event.points)
                for index in event.points:
                    self.skipped.pop(index, None)
                    self.typed.pop(index, None)
                assert record.whole_plot is not None
                self.lost[record.whole_plot] = event.reason
                self.kept += event.kept or 0
                for number in undone(self._by_hand, event.points):
                    self.by_hand.pop(number, None)
                self.whole_plot = self.planned = None


def fold(records: Iterable[Record]) -> RunState:
    """State after all of `records`."""
    state = RunState()
    for record in records:
        state.add(record)
    return state


def read_state(reader: RunReader) -> RunState:
    """State of a run file.

    Raises:
        RunFileError: the file does not verify, or its records contradict one another; names the place.

    """
    try:
        return fold(reader.records())
    except ContentsError as error:
        reader.verify()
        raise makes_no_sense(reader.path, error) from error


def is_simulated(reader: RunReader) -> bool:
    """Whether a run involves no real instrument; reads only a part of the file. Raises `RunFileError` as
    `read_state`.
    """
    try:
        return reader.about().simulated
    except ContentsError:
        return read_state(reader).simulated
