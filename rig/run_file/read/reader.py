"""Reading a run file: one SQLite database that holds a run, append-only, durable, self-checking.

Reading never blocks the writer and changes nothing. `rig.run_file.schema` defines the tables of a run file,
`rig.run_file.chain` the hash chain of its records.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, Self

import apsw

from rig.errors import RunFileError, UsageError
from rig.files.regular import real_path
from rig.procedures.plan.run_list import Factor, Point, RunList, rows_sha256
from rig.run_file.bodies import COUNT, NUMBER, TEXT, WHOLE, ContentsError, shown
from rig.run_file.chain import GENESIS, Record, StoredRow
from rig.run_file.contents import senseless, wrong_column
from rig.run_file.damage.audit import findings
from rig.run_file.events.points import ACCEPTED, Observed
from rig.run_file.events.sessions import RunCreated
from rig.run_file.read.beside import Alone, ForeignFileError, check_journal, check_log, foreign_log, has_log
from rig.run_file.read.safe_opening import (
    by_itself,
    check_header,
    check_name,
    edited,
    makes_no_sense,
    opened_to_read,
    opened_without_log,
    rolled_back,
    size_of,
    unreadable,
)
from rig.run_file.schema import Guarded, Stored

_SLICE = 200
"""Rows of one statement: a longer read transaction would hold up the checkpoints of a writer. Chosen."""
_LOWEST, _HIGHEST = -(2**63), 2**63 - 1
_COLUMNS = "session, kind, elapsed_s, utc_s, run_index, whole_plot, attempt, status, body"


class RunReader:
    """A run file opened read-only, with short transactions that never block the writer."""

    only_reads = True
    """Errors while it is open come from its contents, not from a bench."""

    def __init__(self, path: Path, connection: apsw.Connection) -> None:
        self.path = path
        self._db = connection
        self.guarded = Guarded(connection, lambda: size_of(path))
        self._points: int | None = None

    @classmethod
    def open(cls, path: Path) -> Self:
        """Open for reading. Raises `RunFileError` if this is not a run file, or if files beside it belong to another
        one.
        """
        path = real_path(path)
        check_header(path)
        check_name(path)
        check_journal(path)  # before SQLite opens the file and rolls a journal back that may be foreign
        alone = by_itself(path)
        uri = path.absolute().as_uri()
        try:
            return cls._checked(path, alone, opened_to_read(path, f"{uri}?mode=ro"))
        except RunFileError as error:
            if alone is not None and not isinstance(error, ForeignFileError):
                raise foreign_log(path, alone.records, "cannot be read") from error
            raise
        except apsw.Error as error:
            if alone is not None and isinstance(error, apsw.CorruptError | apsw.NotADBError):
                raise foreign_log(path, alone.records, f"cannot be read ({error})") from error
            if os.access(path.parent, os.W_OK):
                if not rolled_back(path):
                    raise unreadable(path, error) from error
                return cls.open(path)
        # On a read-only medium SQLite cannot create its index of the log; without a log it needs none.
        if any(path.with_name(path.name + suffix).exists() for suffix in ("-wal", "-journal")):
            raise UsageError(
                f"{path} was not closed and lies in a read-only folder: copy it elsewhere with its -wal or -journal"
            )
        try:
            return cls(path, opened_without_log(path))
        except apsw.Error as error:
            raise unreadable(path, error) from error

    @classmethod
    def _checked(cls, path: Path, alone: Alone | None, db: apsw.Connection) -> Self:
        """A reader of a file and its log, if the log belongs to it. Otherwise closes and raises `ForeignFileError`."""
        run = cls(path, db)
        try:
            if alone is not None:
                check_log(path, alone, run.guarded)
        except BaseException:
            db.close()
            raise
        return run

    def close(self) -> None:
        """Close the database; idempotent. No checkpoint is made: the contents of the log are durable."""
        with contextlib.suppress(apsw.Error):
            self._db.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        """Close. Errors of the contents become `RunFileError`, with the file's name.

        These are `ContentsError`, from decoding, and, where nothing is written, SQLite's own errors.
        Any other error is a fault of this program and is passed on.
        """
        self.close()
        if isinstance(error, ContentsError) or (self.only_reads and isinstance(error, apsw.Error)):
            raise makes_no_sense(self.path, error) from error

    def documents(self) -> dict[str, str]:
        """The files from which the run was created, by name."""
        found = self._all("SELECT name, body FROM document ORDER BY name")
        for name, body in found:
            if not isinstance(name, str) or not isinstance(body, str):
                raise ContentsError(f"document {shown(name)} is no text")
        return dict(found)

    def run_list(self) -> RunList:
        """The run list as stored."""
        factors = self.factors()
        width = len(factors)
        points = (
            Point(row[0], row[1], row[2], row[3 : 3 + width], row[3 + width :])
            for rows in self._point_rows(factors)
            for row in rows
            if _is_point(row, width)
        )
        try:
            about = self.about()
            return RunList(factors, points, about.seed, about.steps)
        except ValueError as error:
            raise ContentsError(f"its run list is none: {error}") from error

    def run_list_sha256(self) -> str:
        """Hash of the run list as stored, equal to `RunList.sha256`; computed without creating points."""
        factors = self.factors()
        about = self.about()
        return rows_sha256(factors, about.seed, self._point_rows(factors), about.steps)

    def factors(self) -> tuple[Factor, ...]:
        """Factors of the run list."""
        found = self._all("SELECT name, axis, overtravel, hard, stays FROM factor ORDER BY position")
        for name, axis, overtravel, _, _ in found:
            if not (TEXT.holds(name) and TEXT.holds(axis) and NUMBER.holds(overtravel)):
                raise ContentsError(f"factor {shown(name)} of the run list cannot have {shown((axis, overtravel))}")
        return tuple(Factor(name, axis, o, bool(hard), bool(stays)) for name, axis, o, hard, stays in found)

    def _point_rows(self, factors: Sequence[Factor]) -> Iterator[list[Any]]:
        """Points as (index, replication, whole plot, setpoints..., sides...)."""
        names = [f'"{f.name}"' for f in factors] + [f'"{f.name}_side"' for f in factors]
        return self._slices(f"{', '.join(['run_index', 'replication', 'whole_plot', *names])} FROM point")

    def genesis(self) -> Record:
        """The first record, which defines the run."""
        for _, record, _, _ in self.chained("seq = 1"):
            if (wrong := wrong_column(record)) is not None:
                raise ContentsError(f"{record.named()}: {wrong[1]}")
            if record.kind != RunCreated.kind:
                raise ContentsError(f"record 1 is of kind {shown(record.kind)}, not what a run begins with")
            return record
        raise RunFileError(f"{self.path} holds no records: it was never finished being created; delete it")

    def about(self) -> RunCreated:
        """The definition of the run, by its first record."""
        event = self.genesis().event
        assert isinstance(event, RunCreated)
        return event

    def records(self, kind: str | None = None) -> Iterator[Record]:
        """Records in order, all or of one kind. Raises `ContentsError` at an invalid record."""
        where, values = ("kind = ?", (kind,)) if kind else ("1", ())
        return self._sensible(where, values)

    def recent(self, most: int) -> Iterator[Record]:
        """The last accepted observations, at most `most`, the earliest first."""
        where = "seq IN (SELECT seq FROM record WHERE kind = ? AND status = ? ORDER BY seq DESC LIMIT ?)"
        return self._sensible(where, (Observed.kind, ACCEPTED, most))

    def latest(self, kinds: tuple[str, str], most: int) -> list[Record]:
        """The last records of these kinds, at most `most`, the latest first."""
        where = "seq IN (SELECT seq FROM record WHERE kind = ? OR kind = ? ORDER BY seq DESC LIMIT ?)"
        return list(self._sensible(where, (*kinds, most)))[::-1]

    def salvage(self) -> Iterator[Record]:
        """Every record that can still be read by itself, regardless of the others."""
        with contextlib.suppress(RunFileError):
            last, _ = self.head()
            for seq in range(1, last + 1):
                with contextlib.suppress(RunFileError):
                    yield from self._sensible("seq = ?", (seq,))

    def chained(self, where: str = "1", values: tuple[Stored, ...] = ()) -> Iterator[tuple[int, Record, bytes, bytes]]:
        """Rows as (seq, record, previous, hash), in order."""
        for rows in self.record_rows(where, values):
            for row in rows:
                record = Record._make(row[1:10])
                record.seq = row[0]
                yield row[0], record, _bytes(row[10]), _bytes(row[11])

    def _sensible(self, where: str, values: tuple[Stored, ...]) -> Iterator[Record]:
        """Records with valid columns and valid required fields; other fields of a body are not checked."""
        return (self.sensible(row) for rows in self.record_rows(where, values) for row in rows)

    def sensible(self, row: StoredRow) -> Record:
        """A record from a row of its number and its own columns. Raises `ContentsError` for an invalid row."""
        if self._points is None:
            self._points = int(self._all("SELECT count(*) FROM point")[0][0])
        record = Record._make(row[1:10])
        record.seq = row[0]
        wrong = senseless(record, self._points)
        if wrong is not None:
            raise ContentsError(f"{record.named()}: {wrong[1]}")
        return record

    def record_rows(self, where: str = "1", values: tuple[Stored, ...] = ()) -> Iterator[list[StoredRow]]:
        """Records as stored, in order, in lists of a few hundred."""
        return self._slices(f"seq, {_COLUMNS}, previous, hash FROM record", where, values)

    def head(self) -> tuple[int, bytes]:
        """Number of records and the last one's hash."""
        for seq, own in self._all("SELECT seq, hash FROM record ORDER BY seq DESC LIMIT 1"):
            return seq, _bytes(own)
        return 0, GENESIS

    def holds(self, seq: int, own: bytes) -> bool:
        """Whether there is a record with this number and hash."""
        if seq > _HIGHEST:
            return False
        return bool(self._all("SELECT 1 FROM record WHERE seq = ? AND hash = ?", (seq, own)))

    def verify(self, each: Callable[[Record], object] = lambda _: None) -> None:
        """Check integrity, schema, run list, documents and chain.

        Args:
            each: called with every record in order, so that a state can be folded in the same pass.

        Raises:
            RunFileError: names the first defect and its place; `rig verify` lists all.

        """
        wrong = next(findings(self, thorough=False, each=each), None)
        if wrong is not None:
            self.must_be_its_log()
            raise edited(self.path, str(wrong))

    def must_be_its_log(self) -> None:
        """For a file that does not verify: raise `ForeignFileError` if it verifies without its log."""
        if not has_log(self.path):
            return
        try:
            with RunReader(self.path, opened_without_log(self.path)) as alone:
                if next(findings(alone, thorough=False), None) is not None:
                    return
                records = alone.head()[0]
        except (apsw.Error, RunFileError):
            return
        raise foreign_log(self.path, records, "does not verify")

    def _slices(self, what: str, where: str = "1", values: tuple[Stored, ...] = ()) -> Iterator[list[Any]]:
        """Rows in order of their key, in lists of one slice each. No list of all rows is made and no transaction stays
        open.

        Args:
            what: the key, other columns, and the table.
            where: condition for the rows.
            values: values for the placeholders in `where`.

        """
        key = what.partition(",")[0]
        statement = f"SELECT {what} WHERE {key} >= ? AND ({where}) ORDER BY {key} LIMIT {_SLICE}"
        since = _LOWEST
        while rows := self._all(statement, (since, *values)):
            yield rows
            last = rows[-1][0]
            if last < since:  # a loop in the tree
                raise unreadable(self.path, ValueError(f"{key} {last} comes after {since - 1}"))
            if len(rows) < _SLICE or last == _HIGHEST:
                return
            since = last + 1

    def _all(self, statement: str, values: tuple[Stored, ...] = ()) -> list[Any]:
        try:
            return list(self.guarded.rows(statement, values))
        except (apsw.Error, UnicodeDecodeError) as error:
            raise unreadable(self.path, error) from error


def _is_point(row: Sequence[Any], width: int) -> bool:
    """True for a valid row of the run list, given its number of setpoints. Raises `ContentsError` otherwise."""
    index, replication, whole_plot = row[:3]
    if not (
        COUNT.holds(replication)
        and (whole_plot is None or COUNT.holds(whole_plot))
        and all(map(NUMBER.holds, row[3 : 3 + width]))
        and all(map(WHOLE.holds, row[3 + width :]))
    ):
        raise ContentsError(f"point {shown(index)} of the run list cannot be {shown(tuple(row[1:]))}")
    return True


def _bytes(value: object) -> bytes:
    """A stored hash; empty bytes for anything else."""
    return value if isinstance(value, bytes) else b""
