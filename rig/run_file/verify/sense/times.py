"""Consistency of times: order of records and sessions, readings inside their session, and dates."""

from __future__ import annotations

import re
from collections.abc import Iterator
from datetime import UTC, datetime

from rig.run_file.chain import Record
from rig.run_file.events.event import Event
from rig.run_file.events.points import Observed
from rig.run_file.events.sessions import ClockSet, Hole, RunCreated, SessionBegan
from rig.run_file.state.state import RunState
from rig.run_file.verify.sense.recorded_run import RecordedRun

_ROUNDING_S = 0.002
"""Seconds by which a session's first record may appear to be before the last record of the previous session, and the
readings of a channel to be longer than those of its point."""
_NAMED_S = 3600.0
"""On a real bench the run's name has the date of its first record, to the second."""
_STEP_S = 120.0
"""Step of UTC, seconds, above which a mark is required; controllers mark smaller steps too."""
_NAME = re.compile(r"(\d{8}T\d{6})-")


class Times:
    """Checks the times of every record.

    Args:
        case: the run.

    Attributes:
        doubts: remarks that are possible in an honest run too, but should be looked at.

    """

    def __init__(self, case: RecordedRun) -> None:
        self.doubts: list[str] = []
        self._case = case
        self._step_s = _STEP_S + 2.0 * case.speed
        self._last: Record = case.genesis
        self._began_s = 0.0
        self._observed_s = self._hole_s = 0.0
        self._marks_steps = self._measures = False

    def look(self, record: Record, event: Event, fold: RunState) -> Iterator[str]:
        """Defects of a record: ends of sentences that begin with the record's name."""
        before, self._last = self._last, record
        behind_s = before.elapsed_s - record.elapsed_s
        if behind_s > (_ROUNDING_S if isinstance(event, SessionBegan) else 0.0):
            yield f"its time, {record.elapsed_s:.3f} s, is before that of the record before it, {before.elapsed_s:.3f}"
        match event:
            case RunCreated():
                yield from self._named(record, event)
                return
            case SessionBegan():
                yield from self._session(record, event, before, fold)
            case Observed():
                yield from self._measured(record, event)
            case Hole():
                self._hole_s = record.elapsed_s
        yield from self._date(record, event, before)

    def _named(self, record: Record, run: RunCreated) -> Iterator[str]:
        if record.elapsed_s != 0.0:
            yield f"a run begins at 0 s, not at {record.elapsed_s:g}"
        found = _NAME.match(run.run_id)
        if found is None or run.simulated:
            return
        named = datetime.strptime(found[1], "%Y%m%dT%H%M%S").replace(tzinfo=UTC).timestamp()
        if abs(named - record.utc_s) > _NAMED_S:
            yield f"its date is {_date(record.utc_s)}, the run's name says {_date(named)}"

    def _session(self, record: Record, event: SessionBegan, before: Record, fold: RunState) -> Iterator[str]:
        self._began_s = record.elapsed_s
        self._marks_steps = event.writes_all
        if event.elapsed_s > record.elapsed_s + _ROUNDING_S:
            yield f"it began at {event.elapsed_s:.3f} s, after it was written down at {record.elapsed_s:.3f}"
        gap_s = event.gap_s
        if record.session > 1 and gap_s > record.elapsed_s - before.elapsed_s + _ROUNDING_S:
            yield f"it began after a gap of {gap_s:.0f} s, and {record.elapsed_s - before.elapsed_s:.0f} s had passed"
        last = fold.session
        if last is not None and event.gap_certain and event.gap_known and event.boot == last.boot:
            off_s = event.origin - last.origin
            if abs(off_s) > self._step_s:
                yield f"its clock, which went on since the session before, has other times by {off_s:.0f} s"

    def _measured(self, record: Record, event: Observed) -> Iterator[str]:
        if event.measured_s is not None:
            self._measures = True
            yield from self._read(record, *event.measured_s)
            long_s = event.measured_s[1] - event.measured_s[0] + _ROUNDING_S
            for name, (first, last) in event.taken_s.items():
                if not 0.0 <= first <= last <= long_s:
                    yield (
                        f"{name} was read from {first:.3f} s to {last:.3f} s of its readings, which took {long_s:.3f} s"
                    )
        elif self._measures and event.overload is None:
            yield "it does not say when it was read, as those before it do"
        self._observed_s = record.elapsed_s

    def _read(self, record: Record, began: float, ended: float) -> Iterator[str]:
        if not began <= ended:
            yield f"its readings began at {began:.3f} s and ended at {ended:.3f}"
        if ended > record.elapsed_s:
            yield f"its readings ended at {ended:.3f} s, after it was written down at {record.elapsed_s:.3f}"
        if began < self._began_s:
            yield f"its readings began at {began:.3f} s, before its session, at {self._began_s:.3f}"
        elif began < self._observed_s:
            yield f"its readings began at {began:.3f} s, before the last observation, at {self._observed_s:.3f}"
        elif began < self._hole_s and record.accepted:
            yield f"its readings began at {began:.3f} s, before a hole in time that ended at {self._hole_s:.3f}"

    def _date(self, record: Record, event: Event, before: Record) -> Iterator[str]:
        """Check that dates advance with elapsed time, except for steps of the machine's clock, which a controller
        marks.
        """
        step_s = (record.utc_s - record.elapsed_s) - (before.utc_s - before.elapsed_s)
        marked_s = 0.0
        if isinstance(event, SessionBegan):
            marked_s = event.utc_step_s or 0.0
        elif isinstance(event, ClockSet):
            marked_s = event.step_s
        if abs(step_s - marked_s) <= self._step_s:
            return
        what = f"its date, {_date(record.utc_s)}, is off by {step_s - marked_s:.0f} s from that of the record before it"
        if self._marks_steps:
            yield f"{what}, and nothing says that the clock was set"
        elif record.session > 1 or not isinstance(event, SessionBegan):  # a run may be created long before its start
            self.doubts.append(f"{_name(record)}: {what}: the machine's clock was set, or a date was changed")


def _name(record: Record) -> str:
    at = "" if record.run_index is None else f" of point {record.run_index}"
    return f"{record.kind}{at} in session {record.session}"


def _date(utc_s: float) -> str:
    try:
        return f"{datetime.fromtimestamp(utc_s, UTC):%Y-%m-%d %H:%M:%S}"
    except (OverflowError, ValueError, OSError):
        return f"{utc_s:.0f} s after 1970"
