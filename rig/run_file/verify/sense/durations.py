"""Consistency of durations: whether the work between two records fits into the time between them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from rig.run_file.chain import Record
from rig.run_file.events.bench import EnvironmentSettled, Fault, Prepared, Preparing
from rig.run_file.events.by_hand import AskedToRead, ReadByHand
from rig.run_file.events.event import Event
from rig.run_file.events.points import Observed, TemperaturesLeft, WholePlotBegan
from rig.run_file.events.sessions import SessionBegan
from rig.run_file.state.state import RunState
from rig.run_file.verify.sense.recorded_run import NOTED, RecordedRun

_ROUNDED_S = 0.05
_MOVE_S = 600.0
_LEGS = 4
"""Maximum number of legs to a point; each takes at most ten minutes, or the settling timeout."""
_SLACK_S = 3600.0
_REAL_SLACK_S = 600.0
"""Real seconds for which a busy machine may repeatedly delay a controller without a recorded hole."""
_LINE_HZ = 60.0
_SURE = 0.9


class Durations:
    """Checks durations.

    Args:
        case: the run.

    """

    def __init__(self, case: RecordedRun) -> None:
        self._case = case
        self._before: tuple[Record, Event] | None = None
        self._preparing_s: float | None = None
        self._asked_s: float | None = None
        self._last_s: float | None = None
        self._waited_s = 0.0
        self._writes_all = False
        self._gap_s = 5.0 + 2.0 * case.speed
        conduct = case.conduct
        self._typed = case.typed.keys()
        self._reading_s = 0.0 if conduct is None else conduct.readings * _sweep_s(case)
        self._longest_s = float("inf")
        if conduct is not None:
            settle_s, tries = conduct.settle.timeout_s, conduct.repeats + 1
            reading_s = max(600.0, 60.0 * conduct.readings) + 10.0 * self._reading_s
            self._longest_s = _LEGS * max(_MOVE_S, settle_s) + settle_s + tries * reading_s + _SLACK_S
            self._longest_s += _REAL_SLACK_S * case.speed

    def look(self, record: Record, event: Event, _fold: RunState) -> Iterator[str]:
        """Defects of a record: ends of sentences that begin with the record's name."""
        if isinstance(event, NOTED):
            return
        last, self._last_s = self._last_s, record.elapsed_s
        if isinstance(event, AskedToRead | ReadByHand):  # at the point, between settling and the instruments' readings
            self._asked_s = record.elapsed_s if self._asked_s is None else self._asked_s
            self._waited_s += event.waited_s if isinstance(event, ReadByHand) else 0.0
            return
        before, self._before = self._before, (record, event)
        match event:
            case SessionBegan():
                self._writes_all = event.writes_all
                self._preparing_s = None
                yield from self._gap(event, last)
            case Preparing() | TemperaturesLeft():
                self._preparing_s = record.elapsed_s
            case WholePlotBegan():
                yield from self._settled(record, event.settling)
            case EnvironmentSettled():
                yield from self._settled(record, event.chambers)
            case Prepared():
                self._preparing_s = None
            case Observed(accepted=True) if self._writes_all and before is not None:
                yield from self._observed(record, event, *before)
        self._asked_s, self._waited_s = None, 0.0

    def _gap(self, event: SessionBegan, last_s: float | None) -> Iterator[str]:
        if event.gap_s < 0.0:
            yield f"it began after a gap of {event.gap_s:.0f} s"
        if last_s is None or not event.gap_known or not event.writes_all:
            return
        passed_s = event.elapsed_s - last_s
        if event.gap_s < passed_s - self._gap_s:
            yield f"it began after a gap of {event.gap_s:.0f} s, and {passed_s:.0f} s had passed"

    def _settled(self, record: Record, evidence: Mapping[str, Mapping[str, Any]]) -> Iterator[str]:
        if self._preparing_s is None or not evidence or not self._writes_all:
            return
        took_s = max(one["seconds"] for one in evidence.values())
        passed_s = record.elapsed_s - self._preparing_s
        if took_s > passed_s + _ROUNDED_S:
            yield f"settling took {took_s:.0f} s, and {passed_s:.0f} s had passed since it can have begun"

    def _observed(self, record: Record, event: Observed, before: Record, was: Event) -> Iterator[str]:
        if event.measured_s is None or isinstance(was, SessionBegan):
            return
        began, ended = event.measured_s
        settling_s = max((one["seconds"] for one in event.settling.values()), default=0.0)
        ready_s = began if self._asked_s is None else self._asked_s
        if before.elapsed_s + settling_s > ready_s + _ROUNDED_S:
            yield (
                f"it was read {ready_s - before.elapsed_s:.1f} s after the record before it, and settling took "
                f"{settling_s:.1f} s"
            )
        by_meters = not event.every_reading.keys() <= self._typed
        if ended < began or (by_meters and (ended - began < self._reading_s or ended == began)):
            yield f"it was read within {ended - began:.2f} s, and its meters take {self._reading_s:.2f} s at least"
        longest_s = self._longest_s + self._waited_s + (was.pause_s or 0.0 if isinstance(was, Fault) else 0.0)
        if record.elapsed_s - before.elapsed_s > longest_s:
            hours = (record.elapsed_s - before.elapsed_s) / 3600.0
            yield f"{hours:.1f} h passed since the record before it, and nothing says what was waited for"


def _sweep_s(case: RecordedRun) -> float:
    """Minimum duration of one reading, seconds: the longest integration time in the bench file."""
    if case.bench is None:
        return 0.0
    read = {sensor.reader for sensor in case.bench.sensors.values()}
    given = (case.bench.instruments[name].options.get("nplc", 0.0) for name in read)
    return _SURE * max((float(n) for n in given if isinstance(n, int | float)), default=0.0) / _LINE_HZ
