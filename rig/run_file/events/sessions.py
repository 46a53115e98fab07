"""The run, its sessions, and who took part."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from rig.run_file.bodies import Count, MaybeText, Seconds, Text, Texts, Truth, Whole
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
    from rig.run_file.chain import Record


_UNKNOWN_GAP = "a gap of unknown length: the machine restarted, and its clock was wrong or is"


@dataclass(frozen=True, kw_only=True)
class RunCreated(Event, kind="run", says="run created, {points} points, run list {run_list:.16}..."):
    """What a run is, as it was created.

    Attributes:
        run_id: its name.
        simulated: no real instrument involved.
        documents: digests of its documents, by name.
        run_list: hash of the run list.
        points: length of the run list.
        seed: of the run list.
        dry: whether its instruments are simulated by this program.
        software: versions, by name.
        procedure: name of the procedure.
        bench: name of the bench.
        operator: who created it, and how that is known.
        world_start_s: age of a dry run's world when the run began.

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

    @property
    def runs_dry(self) -> bool:
        """Whether it is a dry run; a simulated one that does not say is taken for one, and commands nothing real."""
        return self.simulated if self.dry is None else self.dry


@dataclass(frozen=True, kw_only=True)
class SessionBegan(Event, kind="session", matters=Importance("session", "info", "start")):
    """A controller was started on the run.

    Attributes:
        operator: who runs it, and how that is known.
        simulated: no real instrument involved.
        pid: of the controller, on its `host`.
        boot: the name of this boot of the bench's clock.
        software: versions, by name.
        utc_step_s: by how much UTC had stepped against bench time since the record before.
        clock_s: reading of the bench's clock, at `elapsed_s` since the run was created.
        gap_s: since the last record, `gap_certain` unless it was bridged by UTC, `gap_known` unless UTC was wrong.
        wal_frames_dropped: of a damaged log, with `wal_commits_lost` records, for `wal_damage`.

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
        """Who runs it, for people; "" if it does not say."""
        return told({"operator": self.operator, "operator_by": self.operator_by})

    @property
    def writes_all(self) -> bool:
        """Whether its controller writes down all that is held against one another; early versions did not."""
        return self.utc_step_s is not None

    @property
    def origin(self) -> float:
        """The clock reading at which the run's elapsed time was zero."""
        return self.clock_s - self.elapsed_s

    def sentence(self, record: Record) -> str:
        """Which session, by whom, after which gap, and what had been lost."""
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
    """An instrument said who it is; it is new, or another one that was accepted.

    Attributes:
        instrument: the bench's name for it.
        maker: as the instrument says, like `model`, `serial` and `firmware`.
        asset: as the bench file says, like `due`, when its own calibration is due.
        confirmed: whether the reply alone tells it from another of its model.
        replaces: the body of the one before.

    """

    instrument: Status
    maker: MaybeText = None
    model: MaybeText = None
    serial: MaybeText = None
    firmware: MaybeText = None
    asset: MaybeText = None
    due: MaybeText = None
    confirmed: Truth = False
    replaces: Mapping[str, Any] | None = None

    def body(self) -> dict[str, Any]:
        """See `Event.body`; what is not known is told as null."""
        return {name: value for name, value in vars(self).items() if name != "instrument"}

    @property
    def words(self) -> str:
        """Who it is."""
        serial = self.serial if self.confirmed else "serial number not told"
        return f"{self.maker} {self.model}, {serial}, asset {self.asset or 'not declared'}"

    def sentence(self, record: Record) -> str:
        """Who it is, and whether in place of another."""
        again = "" if self.replaces is None else ", accepted in place of another one"
        return f"{self.instrument}: {self.words}{again}"


@dataclass(frozen=True, kw_only=True)
class Interruption(Event, status="interrupted", matters=SESSION, exported=True, ends="interrupted ({signal})"):
    """A signal asked for the run to be left for a later resume."""

    signal: Text = "signal"


@dataclass(frozen=True, kw_only=True)
class Held(Event, kind="hold", matters=Importance("decision", "warning", "hold"), exported=True):
    """The run waits for a person."""

    why: Text = ""

    def sentence(self, record: Record) -> str:
        """Where and why."""
        return f"held{at(record)}{f': {self.why}' if self.why else ''}"


@dataclass(frozen=True, kw_only=True)
class Released(Event, kind="release", matters=DECISION, exported=True, says="released"):
    """A person let the run go on."""


@dataclass(frozen=True, kw_only=True)
class Stopped(Event, kind="stop", matters=DECISION, exported=True, ends="stopped on request"):
    """A person asked for the run to be stopped."""


@dataclass(frozen=True, kw_only=True)
class Parked(Event, status="parked", says="parked"):
    """The session ended with its axes where they rest."""


@dataclass(frozen=True, kw_only=True)
class Ended(
    Event,
    kind="end",
    matters=Importance("session", ""),
    ends="{how}",
    says="{how}: {accepted} points observed, {records} records before this one",
):
    """The run is complete.

    Attributes:
        how: "complete".
        accepted: points observed.
        skipped: reasons, by index of the point.
        whole_plots: identities given; None where nothing is hard to change.
        lost: reasons, by identity of the whole plot.
        records: before this one, which the writer of the file fills in.
        head: hash of the record before this one, likewise.

    """

    how: Status = "complete"
    accepted: Count | None = None
    skipped: Texts = EMPTY
    whole_plots: Count | None = None
    lost: Texts | None = None
    records: Count
    head: Text


@dataclass(frozen=True, kw_only=True)
class Rescued(Event, status="rescued", says="the file was moved, deleted or replaced; the run goes on in {to}"):
    """The file lost its name; the run goes on in a copy."""

    to: Text


@dataclass(frozen=True, kw_only=True)
class ClockSet(Event, status="clock-set", exported=True, says="{message}"):
    """The machine's clock was set: dates before and after do not go together."""

    step_s: Seconds
    message: Text


@dataclass(frozen=True, kw_only=True)
class NotNotified(
    Event, status="not-notified", matters=Importance("step", ""), says="{channel} was not told of {about}: {why}"
):
    """Somebody could not be told of something; the log has it from when it happened."""

    channel: Text = ""
    about: Text = ""
    why: Text = ""


@dataclass(frozen=True, kw_only=True)
class Hole(Event, status="hole", matters=LOSS, exported=True):
    """The controller had no turn for longer than waiting explains: it was stopped, or the machine slept.

    Attributes:
        hole_s: how long, less what was being waited for.
        where: in which state.

    """

    hole_s: Seconds
    where: Text = ""

    def sentence(self, record: Record) -> str:
        """How long, where, and what follows."""
        where = at(record) or f" while {self.where}"
        return (
            f"the controller had no turn for {self.hole_s:.0f} s{where} (stopped, or the machine asleep?); "
            f"the bench is checked as after a crash"
        )
