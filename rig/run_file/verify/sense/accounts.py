"""Consistency of counts and names: sessions, instruments, points, whole plots, numbers of the end record."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from rig.procedures.plan.hand_steps import next_step
from rig.run_file.chain import Record
from rig.run_file.events.bench import AsFound, Fault
from rig.run_file.events.by_hand import (
    AskedByHand,
    AskedToRead,
    AskedToSet,
    DoneByHand,
    ReadByHand,
    SetByHand,
)
from rig.run_file.events.event import Event
from rig.run_file.events.points import Observed, Skipped, WholePlotBegan, WholePlotLost
from rig.run_file.events.sessions import Ended, Held, Identified, Interruption, Released, SessionBegan, Stopped
from rig.run_file.state.state import RunState
from rig.run_file.verify.sense.recorded_run import RecordedRun


class Accounts:
    """Checks numbers and names.

    Args:
        case: the run.

    """

    def __init__(self, case: RecordedRun) -> None:
        self._case = case
        self._instruments = set() if case.bench is None else set(case.bench.instruments)
        self._put_off: set[int] = set()
        self._found = False
        self._closed = self._held = ""
        self._all_known = False
        self._asked: AskedToSet | None = None
        self._reading: AskedToRead | None = None
        self._set: dict[str, float] = {}
        self._anew: dict[str, float] = {}

    def look(self, record: Record, event: Event, fold: RunState) -> Iterator[str]:
        """Defects of a record: ends of sentences that begin with the record's name."""
        expected = fold.sessions + isinstance(event, SessionBegan)
        if record.session != expected:
            yield f"it is of session {record.session}, where session {expected} is under way"
        match event:
            case SessionBegan():
                self._found = False
                self._closed = self._held = ""
                self._asked, self._reading, self._set, self._anew = None, None, {}, {}
            case AsFound():
                self._found = True
            case Held():
                self._held = "the run was held"
            case Released():
                self._held = ""
            case Event(kind=AskedByHand.kind):
                yield from self._by_hand(record, event, fold)
            case Stopped():
                self._closed = "the run was stopped"
            case Interruption():
                self._closed = "the session was interrupted"
            case Fault(gives_up=True):
                self._closed = "the session was given up"
            case Identified():
                yield from self._identity(event, fold)
            case Observed():
                yield from self._observation(record, fold)
            case Skipped():
                yield from self._skip(record, event)
            case WholePlotBegan():
                yield from self._begun(record, event, fold)
            case WholePlotLost():
                yield from self._lost(record, event, fold)
            case Ended():
                yield from self._end(event, fold)

    def _begun(self, record: Record, event: WholePlotBegan, fold: RunState) -> Iterator[str]:
        """Check that a whole plot is the next one, and that everything was set for it."""
        if record.whole_plot != fold.whole_plots + 1:
            yield f"it begins whole plot {record.whole_plot}, the next is {fold.whole_plots + 1}"
        if event.setpoints_degC and fold.left_for != event.planned:
            yield "nothing says that temperatures were changed for it"
        for factor, target in event.settings.items():
            if factor in self._case.by_hand and self._anew.pop(factor, None) != target:
                yield f"nothing says that a person set {factor} to {target:g} for it"

    def _identity(self, event: Identified, fold: RunState) -> Iterator[str]:
        if self._instruments and event.instrument not in self._instruments:
            yield f"the bench has no instrument {event.instrument}"
        before = fold.identities.get(event.instrument)
        if event.replaces != before:
            yield f"{event.instrument} replaces {_who(event.replaces)}, and {_who(before)} was there before"

    def _observation(self, record: Record, fold: RunState) -> Iterator[str]:
        assert record.run_index is not None
        if not self._found:
            yield "nothing says how the bench was found in its session"
        if not fold.prepared and fold.whole_plot is None:  # a soak that has just ended is enough
            yield "nothing says that the bench was prepared"
        if self._closed or self._held:
            yield f"it was made after {self._closed or self._held}"
        number = next_step(self._case.run_list.steps, fold.by_hand)
        if number is not None and self._case.run_list.steps[number - 1].before <= record.run_index:
            yield f"nothing says that step {number} by hand was done, which comes before its point"
        setting = self._case.run_list.setting(self._case.run_list.points[record.run_index])
        for factor in self._case.run_list.easy:  # a hard one is set for its whole plot
            target = setting[factor.name]
            if factor.name in self._case.by_hand and self._set.get(factor.name) != target:
                yield f"nothing says that a person set {factor.name} to {target:g} in its session"
        if not self._all_known:
            unknown = sorted(self._instruments - fold.identities.keys())
            self._all_known = not unknown
            if unknown:
                yield f"nothing says who {', '.join(unknown)} is"
        if record.accepted and record.run_index in fold.accepted:
            yield f"point {record.run_index} had an accepted observation already"
        if record.accepted and record.run_index in fold.skipped:
            yield f"point {record.run_index} had been given up for good"
        planned = self._case.run_list.points[record.run_index].whole_plot
        if record.whole_plot != fold.whole_plot:
            yield f"it is of whole plot {record.whole_plot}, where {fold.whole_plot} is open"
        elif planned != fold.planned:
            yield f"its point belongs to whole plot {planned} of the plan, and {fold.planned} is measured"

    def _by_hand(self, record: Record, event: Event, fold: RunState) -> Iterator[str]:
        """Check what a person was asked for, and what was done."""
        match event:
            case AskedByHand():
                self._held = "a person was asked for a step by hand"
                yield from self._step(event, fold)
            case AskedToSet():
                self._held, self._asked = "a person was asked to set a factor", event
            case AskedToRead():
                self._held, self._reading = "a person was asked for a reading", event
            case SetByHand():
                yield from self._setting(event)
            case ReadByHand():
                yield from self._read(record, event, fold)
            case DoneByHand():
                if not self._held:
                    yield "nothing says that a person was asked for it"
                self._held = ""
                yield from self._step(event, fold)

    def _setting(self, event: SetByHand) -> Iterator[str]:
        """Check that a setting by hand is the one that was asked for."""
        asked, self._asked, self._held = self._asked, None, ""
        if asked is None:
            yield "nothing says that a person was asked for it"
        elif (asked.before, asked.factor, asked.setpoint) != (event.before, event.factor, event.setpoint):
            yield f"it is of {event.factor} = {event.setpoint:g}, and {asked.factor} = {asked.setpoint:g} was asked for"
        tolerance = None if self._case.conduct is None else self._case.conduct.tolerances.get(event.factor)
        if event.number is not None and tolerance is not None and abs(event.number - event.setpoint) > tolerance:
            yield f"{event.number:g} was stated for {event.setpoint:g}, more than {tolerance:g} apart"
        self._set[event.factor] = self._anew[event.factor] = event.setpoint

    def _read(self, record: Record, event: ReadByHand, fold: RunState) -> Iterator[str]:
        """Check that a reading by hand is the one that was asked for, and the next one at its point."""
        asked, self._reading, self._held = self._reading, None, ""
        if asked is None or (asked.column, asked.number) != (event.column, event.number):
            yield f"nothing says that a person was asked for reading {event.number} of {event.column}"
        before = fold.typed.get(record.run_index or 0, {}).get(event.column, ())
        if event.number not in (1, len(before) + 1):
            yield f"it is reading {event.number} of {event.column} at its point, and {len(before)} were typed before"

    def _step(self, event: AskedByHand | DoneByHand, fold: RunState) -> Iterator[str]:
        """Check that a step by hand is the next one of the run list."""
        steps, number = self._case.run_list.steps, next_step(self._case.run_list.steps, fold.by_hand)
        if event.step != number:
            yield f"it is of step {event.step} by hand, and the next one is {number or 'none'}"
            return
        step = steps[number - 1]
        if (event.before, event.say, event.change, event.value) != (step.before, step.say, step.change, step.value):
            yield f"it does not go with step {number} by hand of the run list"
        if isinstance(event, DoneByHand) and (event.number is None) is bool(step.value):
            yield "its value is missing" if step.value else "it states a value, and none is asked for"

    def _skip(self, record: Record, event: Skipped) -> Iterator[str]:
        assert record.run_index is not None
        if event.final and record.run_index not in self._put_off:
            yield "it is given up for good without having been put off before"
        self._put_off.add(record.run_index)

    def _lost(self, record: Record, event: WholePlotLost, fold: RunState) -> Iterator[str]:
        if record.whole_plot != fold.whole_plot or event.planned not in (None, fold.planned):
            yield f"it gives up whole plot {record.whole_plot}, and {fold.whole_plot} is open"
            return
        first, count = event.first, event.count
        if fold.planned is None or self._case.run_list.points.span(fold.planned) != (first, count):
            yield f"it gives up points {first} to {first + count - 1}, which are not those of its whole plot"
        kept = len(fold.accepted.intersection(event.points))
        said = (kept if event.kept is None else event.kept) + (event.doubted or 0)
        if said != kept:
            yield f"it counts {said} readings in what is given up, and there are {kept}"

    def _end(self, event: Ended, fold: RunState) -> Iterator[str]:
        if event.accepted != len(fold.accepted):
            yield f"it counts {event.accepted} accepted points, and there are {len(fold.accepted)}"
        skipped = {str(index): why for index, why in fold.skipped.items()}
        if dict(event.skipped) != skipped:
            yield f"it names {len(event.skipped)} skipped points, and not the {len(skipped)} that were"
        if fold.remaining:
            yield f"it says that the run is complete, and {fold.remaining} points have neither observation nor skip"
        if event.whole_plots not in (None, fold.whole_plots):
            yield f"it counts {event.whole_plots} whole plots, and there are {fold.whole_plots}"
        lost = {str(number): why for number, why in fold.lost.items()}
        if event.lost is not None and event.lost != lost:
            yield f"it names {len(event.lost)} lost whole plots, and not the {len(lost)} that were"


def _who(identity: Mapping[str, Any] | None) -> str:
    return "nobody" if identity is None else f"{identity.get('maker')} {identity.get('model')} {identity.get('serial')}"
