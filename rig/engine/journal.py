"""The journal of a session: writes records to the run file and reports progress to observers."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from rig.drivers.clock import Clock
from rig.engine.measuring import Observation
from rig.engine.motion import Leg
from rig.engine.pace import Pace
from rig.engine.session import Progress, Session
from rig.engine.states import State
from rig.engine.time_left import LAST_POINTS, LastPoints, by_hand_s, spent_s
from rig.procedures.plan.run_list import Point
from rig.run_file.chain import Record, encode
from rig.run_file.events.bench import Fault
from rig.run_file.events.event import Event
from rig.run_file.events.points import Observed, WholePlotBegan
from rig.run_file.events.sessions import ClockSet, Ended, SessionBegan
from rig.run_file.live import LiveState
from rig.run_file.state.state import RunState
from rig.run_file.write.writer import RunWriter

_SHOWN_S, _SHOWN = 1800.0, 120
"""Length of a settling quantity's trace in the live state: the last half hour, and a maximum number of samples."""
_CLOCK_SET_S = 60.0
"""A step of UTC relative to bench time larger than this, seconds, is recorded."""
_ONE_MOMENT_S, _READ_AGAIN = 1.0, 3
"""Two clocks read within this time, seconds, show one moment; they are read again at most this often."""


@dataclass
class PointInHand:
    """The state of work on the current point.

    Attributes:
        point: from the run list.
        attempt: counted over all sessions, from 1.
        legs: the way to the point.
        settling: evidence that the axes settled.
        steered: settings that were tried for levels that standards read, and what these read, by factor.
        observation: the readings.
        measured_s: elapsed time when the readings began and ended.
        began_well: whether the instruments were well before its readings.
        repeats: number of repeated readings because of noise.
        rejected: readings that were too noisy.

    """

    point: Point
    attempt: int
    legs: list[Leg] = field(default_factory=list)
    settling: dict[str, Any] = field(default_factory=dict)
    steered: dict[str, Any] = field(default_factory=dict)
    observation: Observation | None = None
    measured_s: tuple[float, float] = (0.0, 0.0)
    began_well: bool = False
    repeats: int = 0
    rejected: list[dict[str, Any]] = field(default_factory=list)

    @property
    def place(self) -> str:
        """Name of the place under which failures are counted."""
        return f"point {self.point.index}"


class Journal:
    """Writes records, keeps their fold up to date, and reports progress.

    Args:
        run: the run file, locked for writing.
        fold: state of the run by its records; updated with every record.
        clock: bench time.
        session: this start of the controller.
        on_progress: called with the progress at every change of state, and about once a second of bench time.
        whole_plots: planned number of whole plots.
        pace: estimate of the remaining time of a run of whole plots.

    Attributes:
        state: where the sequencer is.
        at: the current point, if any; records about it name it.
        message: the present activity, "" if the state says it.
        detail: present readings that belong to the message.
        asked: the step by hand that the run waits for, for the live state; None if there is none.
        moving: returns the axes that are on their way, in words.
        settling: returns the quantities that settle, by name, for some seconds, with at most a number of samples.
        told_s: clock time at which observers were told last.

    """

    def __init__(
        self,
        run: RunWriter,
        fold: RunState,
        clock: Clock,
        session: Session,
        on_progress: Callable[[Progress], None],
        whole_plots: int,
        pace: Pace | None = None,
    ) -> None:
        self.fold = fold
        self._whole_plots = whole_plots
        self._soaks = pace
        self.state = State.READY
        self.at: PointInHand | None = None
        self.message = ""
        self.detail = ""
        self.asked: Mapping[str, Any] | None = None
        self.settling: Callable[[float, int], Mapping[str, Any]] = lambda seconds, most: {}
        self.moving: Callable[[], str] = str
        self._run = run
        self._clock = clock
        self._session = session
        self._on_progress = on_progress
        self._live = LiveState(run.path, clock.stopwatch)
        self._acknowledged = self._refused = ""
        self._taken_up_s = 0.0
        self._left_s: float | None = None  # these two hold until the next record
        self._done: int | None = None
        self._pace = LastPoints(() if pace is not None else spent_s(self.recent(LAST_POINTS)))
        self._first = True
        self.told_s = 0.0
        self._point_s = self._pace.typical_s()
        if pace is not None:
            for record in run.records():
                pace.add(record)

    def elapsed(self) -> float:
        """Bench seconds since the run was created."""
        return self._clock.now() - self._session.elapsed_origin

    def open(self) -> None:
        """Write the record of the session: process, time, gap before it, and entries lost from the log."""
        session, dropped = self._session, self._run.dropped
        gap_s = max(0.0, self.elapsed() - self.fold.elapsed_s) if session.gap_known else 0.0
        self.write(
            SessionBegan(
                **session.about,
                utc_step_s=round(self._step_s(*self._moment()), 3),
                clock_s=self._clock.now(),
                elapsed_s=self.elapsed(),
                gap_s=gap_s,
                gap_certain=session.gap_certain,
                gap_known=session.gap_known,
                wal_frames_dropped=dropped.dropped,
                wal_commits_lost=dropped.lost_commits,
                wal_damage=dropped.damage,
            )
        )
        self.tell(now=True)  # at once, so that nobody takes the last session's state for this one's

    def write(self, event: Event, *, whole_plot: int | None = None, commit: bool = True) -> None:
        """Make an event durable; its record names the point in hand and the open whole plot.

        Args:
            event: the event.
            whole_plot: identity of its whole plot, if not the open one.
            commit: with False it becomes durable together with the next record, or not at all.

        Raises:
            StorageError: the file cannot be written.

        """
        self._note()
        self._add(self._record(event, whole_plot), commit=commit)

    def _note(self) -> None:
        """Write the observer's events: they become durable with the next record, or not at all."""
        for event in self._session.observer.to_note():
            self._add(self._record(event), commit=False)

    def _step_s(self, elapsed_s: float, utc_s: float) -> float:
        """Step of UTC relative to bench time since the last record, seconds."""
        return (utc_s - elapsed_s) - (self.fold.utc_s - self.fold.elapsed_s)

    def _mark_clock(self, record: Record) -> None:
        """Record, before the next record, that the machine's clock was set: earlier and later dates disagree.

        The record of a session contains this itself.
        """
        step_s = self._step_s(record.elapsed_s, record.utc_s)
        if record.kind == SessionBegan.kind or abs(step_s) <= _CLOCK_SET_S + self._clock.grace():
            return
        words = f"the machine's clock was set {'forward' if step_s > 0 else 'back'} by {abs(step_s):.0f} s"
        event = ClockSet(step_s=round(step_s, 3), message=words)
        mark = record._replace(kind=event.kind, status=event.status, body=encode(event.body()))
        self._append(mark._replace(run_index=None, attempt=None), commit=False)

    def _add(self, record: Record, *, commit: bool) -> None:
        self._mark_clock(record)
        self._append(record, commit=commit)

    def _append(self, record: Record, *, commit: bool) -> None:
        self._run.append(record, commit=commit)  # first: nothing counts, and nobody is told, before it is written
        self.fold.add(record)
        self._left_s = self._done = None
        if self._soaks is not None:
            self._soaks.add(record)
        self._session.observer.recorded(record)

    def last_read(self) -> tuple[int, dict[str, Sequence[float]]] | None:
        """Point, and readings of outputs and references, that were read last in any session, accepted or not.

        Readings that were refused because something hung, or was out of range, come after those before them, as
        `Liveness` remembers them.
        """
        every: dict[str, Sequence[float]] = {}
        for record in self._run.latest((Observed.kind, Fault.kind), _LOOKED_BACK):
            read = _readings(record.event)
            if not read or record.run_index is None:
                continue
            every = {name: (*read.get(name, ()), *every.get(name, ())) for name in {**read, **every}}
            if record.accepted or (isinstance(record.event, Fault) and record.event.fault != "frozen"):
                return record.run_index, every
        return None

    def hung(self) -> tuple[int, dict[str, float]]:
        """Point at which outputs or references hung since the last accepted observation, and what they repeated."""
        found: dict[str, float] = {}
        at = -1
        for record in self._run.latest((Observed.kind, Fault.kind), _LOOKED_BACK):
            if record.accepted:
                break
            if isinstance(record.event, Fault) and record.event.fault == "frozen" and record.run_index is not None:
                same = {name: r[0] for name, r in _readings(record.event).items() if len(set(r)) == 1}
                found, at = {**same, **found}, record.run_index if at < 0 else at
        return at, found

    def recent(self, observations: int) -> Iterator[Record]:
        """The last accepted observations of all sessions, the earliest first."""
        return self._run.recent(observations)

    def finish(self, event: Ended) -> None:
        """Write the end record and complete the run file. Raises `StorageError`."""
        self._note()
        record = self._record(event)
        self._mark_clock(record)
        self._run.finish(record)
        self.fold.add(record)
        self._left_s = self._done = None
        self._session.observer.recorded(record)

    def _record(self, event: Event, whole_plot: int | None = None) -> Record:
        at = self.at
        elapsed_s, utc_s = self._moment()
        return Record(
            self._session.number,
            event.kind,
            elapsed_s,
            utc_s,
            at.point.index if at else None,
            self.fold.whole_plot if whole_plot is None else whole_plot,
            at.attempt if at else None,
            event.status,
            encode(event.body()),
        )

    def _moment(self) -> tuple[float, float]:
        """Bench time and UTC of one moment; read again if this process was interrupted between the two readings."""
        clock = self._clock
        for _ in range(_READ_AGAIN):
            now, utc_s = clock.now(), clock.utc()
            if clock.now() - now < _ONE_MOMENT_S:
                break
        return now - self._session.elapsed_origin, utc_s

    def take_up(self, point: Point | None) -> None:
        """Set the current point, or none."""
        self.start_timing()
        self.at = None if point is None else PointInHand(point, self.fold.attempts.count(point.index) + 1)

    def start_timing(self) -> None:
        """Start the time of the current point: earlier holds, retries and preparation do not count."""
        self._taken_up_s = self.elapsed()

    def point_observed(self) -> None:
        """Finish the current point; its duration goes into the estimate of the remaining time."""
        if self._first:  # its way was longer, because of a new start
            self._first = False
        else:
            self._pace.add(self.elapsed() - self._taken_up_s)
            self._point_s = self._pace.typical_s()
            self._left_s = None

    def begin_whole_plot(self, event: WholePlotBegan) -> None:
        """End a soak: what follows belongs to a new whole plot. Raises `StorageError`."""
        self.write(event, whole_plot=self.fold.whole_plots + 1)

    def acknowledge(self, request_id: str, refused: str = "") -> None:
        """Report at once that a person's request has been seen, and why it is refused, "" if it is not."""
        self._acknowledged, self._refused = request_id, refused
        self.tell(now=True)

    def tell(self, *, now: bool = False) -> None:
        """Spread the news."""
        self._live.publish(self._live_content, now=now)
        try:  # noqa: SIM105 - at every poll, and `suppress` takes as long as the rest
            self._on_progress(self._progress())
        except OSError:  # a log that cannot be written must not end a run
            pass

    def close(self) -> None:
        """Remove the live state at the end of the session."""
        self._live.remove()

    def _progress(self) -> Progress:
        fold = self.fold
        if self._done is None:
            self._done = len(fold.accepted) + len(fold.skipped)
        self.told_s = now = self._clock.now()
        elapsed_s = now - self._session.elapsed_origin
        left_s = self._left_s  # only a run without whole plots keeps it until the next record
        if left_s is None:
            left_s = self._remaining_s(elapsed_s)
        return Progress(self.state, self._done, fold.points, elapsed_s, left_s, self.message, self.detail)

    def _remaining_s(self, elapsed_s: float) -> float | None:
        if self._soaks is not None:
            return self._soaks.remaining_s(elapsed_s) + by_hand_s(self.fold)
        if self._left_s is None and self._point_s is not None:
            self._left_s = self.fold.remaining * self._point_s + by_hand_s(self.fold)
        return self._left_s

    def _live_content(self) -> dict[str, Any]:
        p = self._progress()
        return {
            "run_id": self.fold.run_id,
            "simulated": self.fold.simulated,
            "session": self._session.number,
            "pid": self._session.about["pid"],
            "acknowledged": self._acknowledged,
            "refused": self._refused,
            "asked": self.asked,
            "state": p.state,
            "message": p.message,
            "detail": p.detail or self.moving(),
            "done": p.done,
            "points": p.total,
            "elapsed_s": round(p.elapsed_s, 3),
            "remaining_s": None if p.remaining_s is None else round(p.remaining_s, 1),
            "utc_s": round(self._clock.utc(), 3),
            "point": None if self.at is None else self.at.point.index,
            "whole_plot": self.fold.planned,
            "whole_plots": self._whole_plots,
            "settling": self.settling(_SHOWN_S, _SHOWN),
        }


_LOOKED_BACK = 30
"""Number of records among which there are readings, if there were any lately."""


def _readings(event: Event) -> dict[str, Sequence[float]]:
    """Readings by column, without overloads; empty if the event has none."""
    found: Mapping[str, Any] = {}
    if isinstance(event, Observed):
        channels = {**event.references, **event.outputs}
        found = {**event.readings, **{name: channel["readings"] for name, channel in channels.items()}}
    elif isinstance(event, Fault):
        found = (event.evidence or {}).get("readings", {})
    in_range = {name: tuple(r for r in readings if r is not None) for name, readings in found.items()}
    return {name: readings for name, readings in in_range.items() if readings}
