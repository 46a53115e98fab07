"""The program file of a loop, `NAME.loop.sqlite`: its records, and the state that they fold to.

It has the form of a run file, with the documents and the run list of the loop's first run, and is written, chained,
recovered and verified by the same code. `SETTINGS` among its documents makes it a loop.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rig.bench.config import parse_toml, validated
from rig.engine.session import Outcome
from rig.errors import ConfigurationError, UsageError
from rig.files.regular import real_path
from rig.procedures.plan.settings import LoopSettings, Strict
from rig.procedures.present.shell import shell_word
from rig.run_file.chain import Record
from rig.run_file.events.loops import (
    LoopClosed,
    LoopContinued,
    LoopDecided,
    LoopForPerson,
    LoopFound,
    LoopJoined,
    LoopMadeSafe,
    LoopRunEnded,
    LoopRunPlanned,
    LoopWrote,
)
from rig.run_file.read.reader import RunReader
from rig.run_file.state.state import RunState, read_state
from rig.run_file.verify.verification import LOOP, LOOP_SUFFIX

SUFFIX = LOOP_SUFFIX
SETTINGS = LOOP
"""Document with the bounds of the loop, and its files with their hashes."""
ONE_WITH_FIRST = ", one with run 1"
"""Behind the outcome of a run that is evaluated with the first one."""


class FileOfLoop(Strict):
    """A file that the loop began with: its path, and the SHA-256 of its contents."""

    path: str
    sha256: str


class Bounds(Strict):
    """The document `SETTINGS`.

    Attributes:
        ends_s: seconds from the begin of the loop to its end.
        first_h: expected bench time of the first run, hours.
        bounds: those of the procedure.
        goal_s: seconds from the begin of the loop to the deadline of its goal; None for that of the loop.
        files: bench and procedure as given, by name.
    """

    ends_s: float
    first_h: float
    bounds: LoopSettings
    goal_s: float | None = None
    files: dict[str, FileOfLoop]


@dataclass
class LoopRun:
    """A run of a loop: as planned, how it ended (None: not yet), and whether it is evaluated with the first as one."""

    planned: LoopRunPlanned
    ended: LoopRunEnded | None = None
    joined: bool = False

    @property
    def complete(self) -> bool:
        """Whether it can be evaluated."""
        return self.ended is not None and self.ended.how == Outcome.COMPLETE.value


@dataclass
class Program:
    """State of a loop, folded from the records of its file.

    Attributes:
        path: the program file.
        bounds: its document `SETTINGS`.
        documents: texts of the first run's files, by name.
        run: state that run files share: sessions, times.
        runs: its runs, in order.
        found: what was found, by the number of runs that it rests on.
        decided: decisions that no run has followed yet; the last one counts.
        goal: decision that nothing more is done for the goal, by the runs so far; None before.
        story: every record that is told, with its time.
        for_person: what remains for a person, since the last decision to close.
        wrote: written or refused files, since the loop was last continued.
        closed: how it was closed; None while it is open.
        continued: how often it was continued.
        closed_runs: number of its further runs when it was last closed.
        apart: whether runs that were joined to the first were taken apart again.
        left_on: outputs that the last complete run left on for the next one, and nobody has made safe since.
        unsafe: instruments that could not be made safe between two runs.
    """

    path: Path
    bounds: Bounds
    documents: Mapping[str, str]
    run: RunState = field(default_factory=RunState)
    runs: list[LoopRun] = field(default_factory=list)
    found: dict[int, LoopFound] = field(default_factory=dict)
    decided: LoopDecided | None = None
    goal: LoopDecided | None = None
    story: list[Record] = field(default_factory=list)
    for_person: list[LoopForPerson] = field(default_factory=list)
    wrote: dict[str, LoopWrote] = field(default_factory=dict)
    closed: LoopClosed | None = None
    continued: int = 0
    closed_runs: int = 0
    apart: bool = False
    left_on: tuple[str, ...] = ()
    unsafe: tuple[str, ...] = ()
    ends_s: float = 0.0
    allow: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        self.ends_s, self.allow = self.bounds.ends_s, self.bounds.bounds.allow

    def add(self, record: Record) -> None:
        """Take the next record."""
        self.run.add(record)
        if record.event.importance.page:
            self.story.append(record)
        match event := record.event:
            case LoopRunPlanned():
                self.runs.append(LoopRun(event))
                self.decided = None
                self.goal = self.goal if event.segment else None  # what a further run tells may change it
            case LoopRunEnded():
                self.runs[event.number - 1].ended, self.left_on = event, tuple(event.left_on)
            case LoopMadeSafe():
                self.left_on, self.unsafe = (), tuple(event.unsafe)
            case LoopFound():
                self.found[event.after] = event
            case LoopJoined():
                self.runs[event.number - 1].joined = not event.apart
                self.apart |= event.apart
                self.found.pop(self.complete, None)  # other runs judge now, and say other things
            case LoopDecided() if event.next in ("segment", "trace"):
                self.goal = event if event.next == "trace" else None
            case LoopDecided():
                self.decided, self.for_person = event, []
            case LoopForPerson():
                self.for_person.append(event)
            case LoopWrote():
                self.wrote[event.what] = event
            case LoopContinued():
                self.closed = self.decided = self.goal = None
                self.wrote, self.for_person = {}, []
                self.ends_s, self.allow, self.apart = event.ends_s, tuple(event.allow), False
                self.continued += 1
                self.closed_runs = len(self.further_runs)
            case LoopClosed():
                self.closed = event
            case _:
                pass

    @property
    def goal_ends_s(self) -> float:
        """Seconds from the begin of the loop to the time after which no replication is added."""
        return self.ends_s if self.bounds.goal_s is None else min(self.bounds.goal_s, self.ends_s)

    @property
    def last(self) -> LoopRun | None:
        """The last run."""
        return self.runs[-1] if self.runs else None

    @property
    def complete(self) -> int:
        """Number of runs that can be evaluated."""
        return sum(run.complete for run in self.runs)

    def file_of(self, run: LoopRun) -> Path:
        """Path of a run's file."""
        return self.path.with_name(f"{run.planned.run_id}.sqlite")

    @property
    def segments(self) -> list[Path]:
        """Files of the first run, its further replications and the runs joined to it, as far as they are complete."""
        own = [run for number, run in enumerate(self.runs) if number == 0 or run.planned.segment or run.joined]
        return [self.file_of(run) for run in own if run.complete]

    @property
    def replications(self) -> int:
        """Number of complete replications that were added to the first run."""
        return sum(run.planned.segment and run.complete for run in self.runs)

    @property
    def further_runs(self) -> list[LoopRun]:
        """Runs made to decide a question."""
        return [run for run in self.runs[1:] if not run.planned.segment]

    @property
    def further(self) -> list[Path]:
        """Files of the complete further runs that judge: without those that are joined to the first."""
        return [self.file_of(run) for run in self.further_runs if run.complete and not run.joined]

    @property
    def open_run(self) -> LoopRun | None:
        """The run that has not ended; None if there is none."""
        return self.last if self.last is not None and self.last.ended is None else None

    @property
    def on_between_runs(self) -> tuple[str, ...]:
        """Outputs that stay on with no run at work; a run that has begun answers for them itself."""
        run = self.open_run
        return () if run is not None and self.file_of(run).exists() else self.left_on

    @property
    def name(self) -> str:
        """Its name, also of the files that it writes: with a number after it was continued."""
        more = f"-continued-{self.continued}" if self.continued else ""
        return f"{self.path.name.removesuffix(SUFFIX)}{more}"


def read_program(reader: RunReader) -> Program:
    """The state of a loop. Raises `RunFileError`, or `UsageError` if the file is no program file."""
    documents = dict(reader.documents())
    if SETTINGS not in documents:
        raise UsageError(f"{reader.path} is a run file, not the program file of a loop: name NAME{SUFFIX}")
    text = documents.pop(SETTINGS)
    program = Program(reader.path, validated(Bounds, parse_toml(text, SETTINGS), SETTINGS), documents)
    reader.verify(program.add)
    return program


def stopped_run(program: Program) -> Path | None:
    """File of the open run, if a person stopped it. Raises `RunFileError` if it cannot be read."""
    run = program.open_run
    if run is None or not program.file_of(run).exists():
        return None
    with RunReader.open(program.file_of(run)) as reader:
        return program.file_of(run) if read_state(reader).rested == "stopped" else None


def open_program(path: Path) -> Program:
    """The state of a loop in a file; errors as for `read_program`."""
    with RunReader.open(real_path(path)) as reader:
        return read_program(reader)


def run_at_work(path: Path) -> Path:
    """A run file itself; of a program file, the run at which its loop is. Raises `UsageError` between two runs."""
    if not path.name.endswith(SUFFIX):
        return path
    program = open_program(path)
    run = program.open_run
    if run is None or not program.file_of(run).exists():
        raise UsageError(f"no run of {path} is at work; `rig status {shell_word(path)}` shows its state")
    return program.file_of(run)


def file_of(path: Path) -> dict[str, Any]:
    """A file's entry in `Bounds.files`. Raises `UsageError` if it cannot be read."""
    try:
        return {"path": str(path.absolute()), "sha256": hashlib.sha256(path.read_bytes()).hexdigest()}
    except OSError as error:
        raise UsageError(f"{path}: {error.strerror}") from error


def check_unchanged(program: Program) -> None:
    """Refuse to go on with a bench or procedure file that was changed after the loop began.

    A file that is no longer there is no reason: the loop has its contents.

    Raises:
        ConfigurationError: with the name of the file.
    """
    for name, one in program.bounds.files.items():
        path = Path(one.path)
        if path.exists() and hashlib.sha256(path.read_bytes()).hexdigest() != one.sha256:
            raise ConfigurationError(
                f"{path}: the {name} file was changed after the loop began, and a loop has one {name}. Restore it, "
                f"then rig resume {shell_word(program.path)}; or begin a new loop with the changed file"
            )
