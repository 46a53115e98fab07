"""A laboratory: a folder with `people.toml`, whose files' changes are kept in the ledger `log.sqlite`."""

from __future__ import annotations

import contextlib
import hashlib
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from difflib import unified_diff
from pathlib import Path
from typing import Any

from rig.bench.config import parse_toml, read_text
from rig.errors import RunFileError, UsageError
from rig.files.atomic import write_whole
from rig.files.regular import open_regular
from rig.files.temporary import locked
from rig.files.toml_text import toml_text
from rig.lab.masked import without_secrets
from rig.lab.people import FILE, People, parse_people
from rig.run_file.approval import digests_of
from rig.run_file.chain import Record
from rig.run_file.events.event import Event
from rig.run_file.events.laboratory import ApprovalUsed, Decided, FileChanged, Proposed
from rig.run_file.verify.verification import LOG, verify_file
from rig.run_file.write.ledger import Ledger
from rig.who import Operator

_LOG = "log.sqlite"
_MOST_FILES, _MOST_TEXT, _MOST_BYTES = 500, 200_000, 4 << 20


@dataclass
class Proposal:
    """A proposal.

    Attributes:
        asked: as it was made.
        asked_utc_s: when, seconds since 1970-01-01.
        decided: how it was decided; None while it waits.
        used: id of the run that used its approval; "" if none has.
    """

    asked: Proposed
    asked_utc_s: float
    decided: Decided | None = None
    used: str = ""

    @property
    def number(self) -> int:
        """Its number."""
        return self.asked.number

    @property
    def state(self) -> str:
        """One word: "waiting", "approved", "declined", "used"."""
        return "used" if self.used else "waiting" if self.decided is None else self.decided.decision

    def to_json(self) -> dict[str, Any]:
        """JSON values, without the texts of its files."""
        asked, decided = self.asked, self.decided
        return {
            "number": self.number,
            "state": self.state,
            "procedure": asked.procedure,
            "bench": asked.bench,
            "why": asked.why,
            "who": asked.who,
            "decided_by": "" if decided is None else decided.who,
            "decided_why": "" if decided is None else decided.why,
            "used_by": self.used,
            "dry": dict(asked.dry),
            "sha256": {**digests_of(asked.documents), "run list": asked.run_list},
        }


@dataclass
class Log:
    """State of a log, folded from its records.

    Attributes:
        records: all of them.
        proposals: by number.
        files: by file, its last SHA-256.
        texts: by file, its last text.
    """

    records: list[Record] = field(default_factory=list)
    files: dict[str, str] = field(default_factory=dict)
    texts: dict[str, str] = field(default_factory=dict)
    proposals: dict[int, Proposal] = field(default_factory=dict)

    def add(self, record: Record) -> None:
        """Take the next record."""
        self.records.append(record)
        match event := record.event:
            case FileChanged():
                self.files[event.file], self.texts[event.file] = event.after, event.text
            case Proposed():
                self.proposals[event.number] = Proposal(event, record.utc_s)
            case Decided() if event.number in self.proposals:
                self.proposals[event.number].decided = event
            case ApprovalUsed() if event.number in self.proposals:
                self.proposals[event.number].used = event.run
            case _:
                pass


@dataclass(frozen=True)
class Laboratory:
    """A laboratory, by its folder.

    Attributes:
        folder: of its people, settings and results.
        database: address of the database in which its index is kept; "" for a file in the folder.
    """

    folder: Path
    database: str = ""

    @property
    def people_file(self) -> Path:
        """Its people."""
        return self.folder / FILE

    @property
    def log_file(self) -> Path:
        """Its log."""
        return self.folder / _LOG

    @property
    def ledger(self) -> Ledger:
        """The log, to append to."""
        return Ledger(self.log_file, LOG, "log")

    def people(self) -> People:
        """Its people. Raises `ConfigurationError`."""
        return parse_people(read_text(self.people_file, "people"), str(self.people_file))

    def verified_log(self) -> Log:
        """State of the log, after its chain was verified. Raises `RunFileError` if it was edited or damaged."""
        if self.log_file.exists() and not (found := verify_file(self.log_file)).whole:
            raise RunFileError(f"{self.log_file} was edited or damaged: {found.findings[0]}")
        return self.log()

    def log(self) -> Log:
        """State of the log; empty if there is none."""
        return self.ledger.read(Log()) if self.log_file.exists() else Log()

    def change_people(self, change: Callable[[dict[str, Any]], object], why: str, by: Operator) -> None:
        """Change `people.toml`, and write it into the log.

        Args:
            change: changes the tables of the people, by login.
            why: the command.
            by: who changes it.

        Raises:
            ConfigurationError: the file cannot be used, before or after the change.
            UsageError: as `change` raises it, or the disk refuses.
        """
        path = self.people_file
        with self.changing(why, by):
            values = parse_toml(read_text(path, "people"), str(path), shown=False) if path.exists() else {}
            people = values.setdefault("people", {})
            kept = parse_people(toml_text(values), str(path)).having("administrator")
            change(people)
            text = toml_text(values)
            if not parse_people(text, str(path)).having("administrator") and kept:
                raise UsageError("nobody would be administrator then; make somebody else administrator first")
            if not path.exists():  # hashes are for nobody else to read
                os.close(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600))
            write_whole(path, lambda file: file.write(f"# Written by rig person.\n{text}"))

    @contextlib.contextmanager
    def changing(self, why: str, by: Operator) -> Iterator[None]:
        """Change settings files in this block; the log says then who did it, and by which command.

        Args:
            why: the command.
            by: who changes them.
        """
        with locked(self.folder):
            self._note(by, "")
            yield
            self._note(by, why)

    def note_changes(self, by: Operator) -> Log:
        """Write into the log which files of the laboratory are others than it has, found by a person."""
        with locked(self.folder):
            return self._note(by, "")

    def _note(self, by: Operator, why: str) -> Log:
        found = dict(self._files())
        known = self.log()
        if found == {name: digest for name, digest in known.files.items() if digest}:
            return known
        return self.ledger.append(Log(), lambda log: list(self._changes(log, found, by, why)))

    def append(self, decide: Callable[[Log], Sequence[Event]]) -> Log:
        """Write events into the log, see `Ledger.append`."""
        return self.ledger.append(Log(), decide)

    def _changes(self, log: Log, found: dict[str, str], by: Operator, why: str) -> Iterator[FileChanged]:
        for name in sorted({**log.files, **found}):
            before, after = log.files.get(name, ""), found.get(name, "")
            if before != after:
                text = self._text(name) if after else ""
                yield FileChanged(file=name, before=before, after=after, text=text, why=why, who=by.name, who_by=by.by)

    def _files(self) -> Iterator[tuple[str, str]]:
        """Every settings file, and its SHA-256."""
        for path in self._paths()[:_MOST_FILES]:
            with contextlib.suppress(OSError), open_regular(path) as file:
                yield str(path.relative_to(self.folder)), hashlib.sha256(file.read(_MOST_BYTES)).hexdigest()

    def _paths(self) -> list[Path]:
        """Settings files; the people are the first."""
        found = [*self.folder.glob("*.toml"), *self.folder.glob("*/*.toml")]
        return sorted(found, key=lambda path: (path != self.people_file, path))

    def beyond(self) -> int:
        """How many settings files are not looked at, because there are too many."""
        return max(0, len(self._paths()) - _MOST_FILES)

    def _text(self, name: str) -> str:
        """Text of a file without its passwords; "" if it is long, or cannot be read."""
        try:
            with open_regular(self.folder / name) as file:
                text = file.read(_MOST_BYTES).decode()
        except (OSError, UnicodeDecodeError):
            return ""
        return without_secrets(text) if len(text) <= _MOST_TEXT else ""


def laboratory_of(path: Path) -> Laboratory | None:
    """The laboratory of a file or folder: the nearest folder above it, or it, with a `people.toml`."""
    here = Path(os.path.abspath(path))
    return next((Laboratory(one) for one in (here, *here.parents) if (one / FILE).is_file()), None)


def laboratory_in(folder: Path) -> Laboratory:
    """The laboratory of a folder. Raises `UsageError` if it has none."""
    found = laboratory_of(folder)
    if found is None:
        raise UsageError(
            f"{folder} is in no laboratory with people: `rig person add LOGIN --name NAME --roles administrator` in "
            f"its folder begins one"
        )
    return found


def differences(log: Log, last: int | None = None) -> Iterator[tuple[Record, list[str]]]:
    """Every record of a log, or its last ones, and the lines of a file that it took away ("-") or brought ("+")."""
    texts: dict[str, str] = {}
    first = 0 if last is None else len(log.records) - last
    for index, record in enumerate(log.records):
        lines: list[str] = []
        if isinstance(event := record.event, FileChanged):
            if index >= first:
                before = texts.get(event.file, "").splitlines()
                lines = list(unified_diff(before, event.text.splitlines(), lineterm="", n=0))[2:]
            texts[event.file] = event.text
        if index >= first:
            yield record, [one for one in lines if not one.startswith("@@")]
