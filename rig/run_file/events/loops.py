"""Events of a loop: runs that it plans, what they tell, decisions with their reasons, and files that it writes.

They are the records of a program file, `NAME.loop.sqlite`, which has the form of a run file: the documents and the run
list of its first run, and these events.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from rig.procedures.present.durations import duration
from rig.run_file.bodies import Count, Number, Numbers, Seconds, Text, Texts, Truth, Words
from rig.run_file.events.event import DECISION, EMPTY, SESSION, STEP, Event, Importance, Status

if TYPE_CHECKING:
    from rig.run_file.columns import Columns

TOLD = Importance("decision", "info", "loop")
"""Decisions of a loop, which people are told."""
_UNSAFE = Importance("fault", "error")


@dataclass(frozen=True, kw_only=True)
class LoopRunPlanned(Event, kind="loop-run", status="planned", matters=STEP):
    """A run is about to be created, from the loop's documents and this procedure.

    Attributes:
        number: its ordinal in the loop, from 1.
        run_id: name of the run; its file is beside the program file.
        what: its difference from the first run, in words.
        hours: expected bench time.
        procedure: text of its procedure.
        begins_s: seconds from the begin of the loop to its begin.
        segment: whether it is one more replication of the first run, for its goal.
    """

    number: Count
    run_id: Text
    what: Text
    hours: Number
    procedure: Text
    begins_s: Seconds
    segment: Truth = False

    def sentence(self, record: Columns) -> str:
        """Its number, what it is, and its length."""
        return f"run {self.number}: {self.what}, about {duration(3600.0 * self.hours)}"


@dataclass(frozen=True, kw_only=True)
class LoopRunEnded(Event, kind="loop-run", status="ended", matters=SESSION):
    """A run of the loop ended for good.

    Attributes:
        number: its ordinal.
        how: outcome: "complete", or that of a fault.
        head: hash of its last record.
        accepted: number of its observed points.
        points: length of its run list.
        took_s: bench time.
        message: reason of its end, "" if none is needed.
        left_on: outputs that stay on for the next run, with their values.
    """

    number: Count
    how: Text
    head: Text
    accepted: Count
    points: Count
    took_s: Seconds
    message: Text = ""
    left_on: Words = EMPTY

    def sentence(self, record: Columns) -> str:
        """Its outcome, points and time."""
        why = f": {self.message}" if self.message else ""
        done = f"{self.accepted} of {self.points} points in {duration(self.took_s)}"
        on = f"; for the next run {' and '.join(self.left_on)}" if self.left_on else ""
        return f"run {self.number} ended, {self.how}{why}; {done}{on}"


@dataclass(frozen=True, kw_only=True)
class LoopMadeSafe(Event, kind="loop", status="safe", says="{words} ({why})"):
    """What had stayed on between two runs was brought to its safe state.

    Attributes:
        words: how long it took, or what is not safe.
        why: reason.
        unsafe: instruments that could not be shown to be safe, one sentence each.
    """

    words: Text
    why: Text
    unsafe: Words = EMPTY

    @property
    def importance(self) -> Importance:
        """An unsafe bench has the highest importance."""
        return _UNSAFE if self.unsafe else SESSION


@dataclass(frozen=True, kw_only=True)
class LoopFound(Event, kind="loop", status="found", matters=DECISION, says="{words}"):
    """Findings of fit and trace of the first run, or of a judgement by all runs so far.

    Attributes:
        after: number of the runs that it rests on.
        words: one or more sentences.
        verdicts: by sensor after the first run, by effect after a further one.
        holds: explanations that remain, by effect.
        before: error of prediction with the declared model on the further runs, by sensor.
        with_effects: the same with the effects.
        unit: of the errors.
    """

    after: Count
    words: Text
    verdicts: Texts
    holds: Texts = EMPTY
    before: Numbers = EMPTY
    with_effects: Numbers = EMPTY
    unit: Text = ""


@dataclass(frozen=True, kw_only=True)
class LoopDecided(Event, kind="loop", status="decided", matters=TOLD, says="{why}"):
    """The next step, and why.

    Attributes:
        after: number of the runs before it.
        next: "run" or "close"; "segment", of further replications, or "trace" once nothing more is done for the goal.
        why: a sentence with numbers.
        left_h: time left, hours.
        hours: bench time of the next run.
        chance: probability that it settles its most difficult question.
        gain_per_h: probability to settle an open question, on average over the open ones, per hour.
        settled: whether one explanation remains for every effect found.
    """

    after: Count
    next: Text
    why: Text
    left_h: Number
    hours: Number | None = None
    chance: Number | None = None
    gain_per_h: Number | None = None
    settled: Truth = False


@dataclass(frozen=True, kw_only=True)
class LoopJoined(Event, kind="loop", status="joined", matters=TOLD, says="{why}"):
    """A further run is evaluated with the first one as one run from now on, or no longer.

    Attributes:
        number: its ordinal in the loop.
        why: a sentence with the effects that they show together.
        apart: whether they are taken apart again.
    """

    number: Count
    why: Text
    apart: Truth = False


@dataclass(frozen=True, kw_only=True)
class LoopForPerson(Event, kind="loop", status="for-person", matters=DECISION):
    """A task that remains for a person: a run that the bench alone cannot make, or has no time for.

    Attributes:
        after: number of the runs before it.
        do: what the person has to do, "" if the run only needs time.
        what: the run.
        hours: its bench time.
        decides: pairs of explanations, or single ones, with the probability that it settles them, in words.
    """

    after: Count
    do: Text
    what: Text
    hours: Number
    decides: Text

    def sentence(self, record: Columns) -> str:
        """The task, and the questions that it would decide."""
        hours = duration(3600.0 * self.hours)
        return f"for a person: {self.do or 'give it time'}; {self.what}, {hours}, would decide {self.decides}"


@dataclass(frozen=True, kw_only=True)
class LoopWrote(Event, kind="loop", matters=STEP):
    """A file was written, or refused.

    Attributes:
        what: "calibration", "report" or "certificate".
        files: name and SHA-256 of each file.
        why: reason of a refusal, "" if it was written.
        about: further values.
    """

    what: Status
    files: Texts = EMPTY
    why: Text = ""
    about: Mapping[str, Any] = EMPTY

    def sentence(self, record: Columns) -> str:
        """Files, or why there are none."""
        return f"{self.what}: {self.why or ', '.join(self.files)}"


@dataclass(frozen=True, kw_only=True)
class LoopContinued(Event, kind="loop", status="continued", matters=DECISION, says="goes on: {why}"):
    """A closed loop goes on, with more time.

    Attributes:
        ends_s: new end, seconds from the begin of the loop.
        allow: in what further runs may differ from now on.
        why: reason.
    """

    ends_s: Seconds
    allow: Words
    why: Text


@dataclass(frozen=True, kw_only=True)
class LoopClosed(
    Event, kind="loop", status="closed", matters=Importance("session", "info", "finish"), says="closed: {why}"
):
    """The loop is closed: its files are written.

    Attributes:
        settled: whether one explanation remains for every effect found.
        fault: whether a run ended by a fault.
        heads: hash of the last record of every run, by its file.
        why: reason.
        bench_h: bench hours of all runs.
    """

    settled: Truth
    fault: Truth
    heads: Texts
    why: Text
    bench_h: Number
