"""Events of the run and its sessions, instruments and operators."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from rig.procedures.plan.hand_steps import HandStep
from rig.run_file.bodies import Count, MaybeText, Seconds, Steps, Text, Texts, Truth, Whole, Words
from rig.run_file.events.event import (
    DECISION,
    EMPTY,
    LOSS,
    SESSION,
    Event,
    Importance,
    Status,
    at,
)
from rig.who import told

if TYPE_CHECKING:
    from rig.run_file.columns import Columns


def _by(who: str | None) -> str:
    return f" by {who}" if who else ""


_UNKNOWN_GAP = "a gap of unknown length: the machine restarted, and its clock was wrong or is"


@dataclass(frozen=True, kw_only=True)
class RunCreated(Event, kind="run", says="run created, {points} points, run list {run_list:.16}..."):
    """The definition of a run, written at its creation.

    Attributes:
        run_id: its name.
        simulated: whether no real instrument is involved.
        documents: digests of its documents, by name.
        run_list: hash of the run list.
        points: length of the run list.
        seed: seed of the run list.
        dry: whether its instruments are simulated by this program.
        software: versions, by name.
        procedure: name of the procedure.
        bench: name of the bench.
        operator: person who created it, and source of the name.
        world_start_s: age of a dry run's world when the run began.
        by_hand: what a person does in it, part of its run list.

    """

    run_id: Text
    simulated: Truth
    documents: Texts
    run_list: Text
    points: Count
    seed: Whole
    dry: Truth | None = None
    software: Texts = EMPTY
    procedure: Text | None = None
    bench: Text | None = None
    operator: Text | None = None
    operator_by: Text | None = None
    world_start_s: Seconds | None = None
    by_hand: Steps = EMPTY

    @property
    def steps(self) -> tuple[HandStep, ...]:
        """Steps that a person does in it, in the order of the points."""
        names = HandStep.__dataclass_fields__.keys()
        given = () if self.by_hand is EMPTY else self.by_hand
        return tuple(HandStep(**{name: value for name, value in step.items() if name in names}) for step in given)

    @property
    def runs_dry(self) -> bool:
        """Whether it is a dry run. A simulated run without this field counts as one, because it commands nothing
        real.
        """
        return self.simulated if self.dry is None else self.dry


@dataclass(frozen=True, kw_only=True)
class SessionBegan(Event, kind="session", matters=Importance("session", "info", "start")):
    """A controller was started on the run.

    Attributes:
        operator: person who runs it, and source of the name.
        simulated: whether no real instrument is involved.
        pid: process id of the controller, on its `host`.
        boot: identifier of this boot of the bench's clock.
        software: versions, by name.
        utc_step_s: step of UTC relative to bench time since the previous record.
        clock_s: reading of the bench's clock, at `elapsed_s` since the run was created.
        gap_s: time since the last record; `gap_certain` unless bridged by UTC, `gap_known` unless UTC was
            wrong.
        wal_frames_dropped: dropped frames of a damaged log, with `wal_commits_lost` records, because of
            `wal_damage`.

    """

    operator: Text | None = None
    operator_by: Text | None = None
    simulated: Truth | None = None
    pid: Count | None = None
    host: Text | None = None
    boot: Text | None = None
    software: Texts = EMPTY
    utc_step_s: Seconds | None = None
    clock_s: Seconds
    elapsed_s: Seconds
    gap_s: Seconds = 0.0
    gap_certain: Truth = True
    gap_known: Truth = True
    wal_frames_dropped: Count = 0
    wal_commits_lost: Count = 0
    wal_damage: Text = ""

    @property
    def by(self) -> str:
        """Operator, for people; "" if unknown."""
        return told({"operator": self.operator, "operator_by": self.operator_by})

    @property
    def writes_all(self) -> bool:
        """Whether its controller records everything that the consistency checks need; early versions did not."""
        return self.utc_step_s is not None

    @property
    def origin(self) -> float:
        """The clock reading at which the run's elapsed time was zero."""
        return self.clock_s - self.elapsed_s

    def sentence(self, record: Columns) -> str:
        """Session, operator, gap before it, and lost records."""
        words = f"session {record.session} began{f', operator {self.by}' if self.by else ''}"
        if record.session > 1:
            certain = "" if self.gap_certain else " (by UTC, across a restart of the machine)"
            gap = f"a gap of {self.gap_s:.0f} s{certain}" if self.gap_known else _UNKNOWN_GAP
            words += f" after {gap}"
        if self.wal_commits_lost:
            words += f"; {self.wal_commits_lost} record(s) had been lost from a damaged log ({self.wal_damage})"
        return words


@dataclass(frozen=True, kw_only=True)
class Identified(Event, kind="identity"):
    """The identity of an instrument; it is new, or an accepted exchange.

    Attributes:
        instrument: the bench's name for it.
        maker: by the instrument, like `model`, `serial` and `firmware`.
        asset: by the bench file, like `due`, the date of its next calibration.
        confirmed: whether the reply alone distinguishes it from another one of its model.
        simulated: whether a simulator answered in its place, so that nothing is confirmed.
        replaces: body of its predecessor.

    """

    instrument: Status
    maker: MaybeText = None
    model: MaybeText = None
    serial: MaybeText = None
    firmware: MaybeText = None
    asset: MaybeText = None
    due: MaybeText = None
    confirmed: Truth = False
    simulated: Truth = False
    replaces: Mapping[str, Any] | None = None

    def body(self) -> dict[str, Any]:
        """Fields besides its own columns; unknown ones are null. A record of real instruments names no simulator."""
        left = {"instrument"} if self.simulated else {"instrument", "simulated"}
        return {name: value for name, value in vars(self).items() if name not in left}

    @property
    def words(self) -> str:
        """Who it is."""
        serial = self.serial if self.confirmed else "serial number not told"
        if self.simulated:
            serial = "simulated, so its identity is not confirmed"
        return f"{self.maker} {self.model}, {serial}, asset {self.asset or 'not declared'}"

    def sentence(self, record: Columns) -> str:
        """Identity, and whether it replaces another instrument."""
        again = "" if self.replaces is None else ", accepted in place of another one"
        return f"{self.instrument}: {self.words}{again}"


@dataclass(frozen=True, kw_only=True)
class Interruption(Event, status="interrupted", matters=SESSION, exported=True, ends="interrupted ({signal})"):
    """A signal ended the session; the run can be resumed.

    Attributes:
        signal: its name.
        left_on: outputs that stay on, with their values, one sentence each.
        unsafe: instruments that were to be switched off and are not, one sentence each.

    """

    signal: Text = "signal"
    left_on: Words = EMPTY
    unsafe: Words = EMPTY


@dataclass(frozen=True, kw_only=True)
class Held(Event, kind="hold", matters=Importance("decision", "warning", "hold"), exported=True):
    """The run holds for a person: for `why`, asked for by `who`, None if nobody is known."""

    why: Text = ""
    who: Text | None = None

    def sentence(self, record: Columns) -> str:
        """Where and why."""
        return f"held{at(record)}{f': {self.why}' if self.why else ''}{_by(self.who)}"


@dataclass(frozen=True, kw_only=True)
class Released(Event, kind="release", matters=DECISION, exported=True):
    """A person, `who` if it is known, released the hold."""

    who: Text | None = None

    def sentence(self, record: Columns) -> str:
        """By whom."""
        return f"released{_by(self.who)}"


@dataclass(frozen=True, kw_only=True)
class Stopped(Event, kind="stop", matters=DECISION, exported=True):
    """A person, `who` if it is known, asked to stop the run."""

    who: Text | None = None

    @property
    def ending(self) -> str:
        """How it ends its session, in words."""
        return f"stopped on request{_by(self.who)}"

    def sentence(self, record: Columns) -> str:
        """By whom."""
        return self.ending


@dataclass(frozen=True, kw_only=True)
class Parked(Event, status="parked", says="parked"):
    """The session ended with its axes in their parking positions."""


@dataclass(frozen=True, kw_only=True)
class Ended(
    Event,
    kind="end",
    matters=Importance("session", ""),
):
    """The run is complete.

    Attributes:
        how: "complete".
        accepted: number of observed points.
        skipped: reasons, by index of the point.
        whole_plots: number of identities given; None if no factor is hard to change.
        lost: reasons, by identity of the whole plot.
        records: number of records before this one; filled in by the writer of the file.
        head: hash of the record before this one; likewise.

    """

    how: Status = "complete"
    accepted: Count | None = None
    skipped: Texts = EMPTY
    whole_plots: Count | None = None
    lost: Texts | None = None
    records: Count
    head: Text

    @property
    def ending(self) -> str:
        """How it ends its session, in words; "" if it does not end it. Lost points are said."""
        return f"{self.how}, without {len(self.skipped)} of its points" if self.skipped else self.how

    def sentence(self, record: Columns) -> str:
        """How many points it has, and how many were lost."""
        lost = f", {len(self.skipped)} lost" if self.skipped else ""
        return f"{self.how}: {self.accepted} points observed{lost}, {self.records} records before this one"


@dataclass(frozen=True, kw_only=True)
class Rescued(Event, status="rescued", says="the file was moved, deleted or replaced; the run goes on in {to}"):
    """The file was moved, deleted or replaced; the run continues in a copy."""

    to: Text


@dataclass(frozen=True, kw_only=True)
class ClockSet(Event, status="clock-set", exported=True, says="{message}"):
    """The machine's clock was set: earlier and later dates disagree."""

    step_s: Seconds
    message: Text


@dataclass(frozen=True, kw_only=True)
class NotNotified(
    Event,
    status="not-notified",
    matters=Importance("step", ""),
    says="{channel} did not receive the message about {about}: {why}",
):
    """A message could not be sent; the log has it from the time of its event."""

    channel: Text = ""
    about: Text = ""
    why: Text = ""


@dataclass(frozen=True, kw_only=True)
class Hole(Event, status="hole", matters=LOSS, exported=True):
    """The controller did not run for longer than its waits explain: it was stopped, or the machine slept.

    Attributes:
        hole_s: length, less any announced wait, seconds.
        where: state of the sequencer.

    """

    hole_s: Seconds
    where: Text = ""

    def sentence(self, record: Columns) -> str:
        """Length, place, and consequence."""
        where = at(record) or f" while {self.where}"
        return (
            f"the controller had no turn for {self.hole_s:.0f} s{where} (stopped, or the machine asleep?); "
            f"the bench is checked as after a crash"
        )
