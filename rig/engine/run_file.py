"""The run file: one SQLite database that holds a run, append-only, durable, self-checking.

Write-ahead log with synchronous=FULL: a commit that returned survives a power cut. One connection writes, ever.
Triggers refuse UPDATE and DELETE, records are chained by hash (`rig.engine.chain`), and a partial unique index
makes a second accepted observation of a point in one whole plot impossible. A finished run leaves WAL mode: one
ordinary file.
"""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Self

import apsw

from drivers.clock import RealClock
from procedures import Factor, Point, RunList
from rig.engine import wal
from rig.engine.audit import findings
from rig.engine.chain import GENESIS, Record, encode, link
from rig.engine.last_word import LastWord, read_last_word
from rig.engine.rescue import is_still_at, rescue
from rig.engine.schema import APPLICATION_ID, SCHEMA_VERSION, Guarded, guard, statements, strange_tables
from rig.engine.storage import storage_of
from rig.errors import BusyError, RunFileError, StorageError, UsageError

_SLICE = 200
_LOWEST, _HIGHEST = -(2**63), 2**63 - 1
_INSERT = f"INSERT INTO record VALUES ({', '.join('?' * 12)})"
_COLUMNS = "session, kind, elapsed_s, utc_s, run_index, whole_plot, attempt, status, body"


@dataclass(frozen=True)
class Genesis:
    """What a run is, fixed when it is created.

    Attributes:
        run_id: its name, also the file's.
        documents: the bench, procedure (and, for a dry run, world) files as given, by name.
        run_list: every point.
        simulated: whether no real instrument is involved.
        about: versions and whatever else should travel with the run.

    """

    run_id: str
    documents: Mapping[str, str]
    run_list: RunList
    simulated: bool
    about: Mapping[str, Any]


class RunReader:
    """A run file opened read-only: short transactions, never in the writer's way."""

    def __init__(self, path: Path, connection: apsw.Connection) -> None:
        self.path = path
        self._db = connection
        self.guarded = Guarded(connection, lambda: _size(path))

    @classmethod
    def open(cls, path: Path) -> Self:
        """Open for reading. Raises `RunFileError` if this is not a run file."""
        _check_header(path)
        uri = path.absolute().as_uri()
        try:
            return cls(path, _opened(path, f"{uri}?mode=ro"))
        except apsw.Error as error:
            if os.access(path.parent, os.W_OK):
                if not _rolled_back(path):
                    raise _unreadable(path, error) from error
                return cls.open(path)
        # On a read-only medium SQLite cannot make its index of the log; without a log it needs none.
        if any(path.with_name(path.name + suffix).exists() for suffix in ("-wal", "-journal")):
            raise UsageError(
                f"{path} was not closed and lies in a read-only folder: copy it elsewhere with its -wal or -journal"
            )
        try:
            return cls(path, _opened(path, f"{uri}?mode=ro&immutable=1"))
        except apsw.Error as error:
            raise _unreadable(path, error) from error

    def close(self) -> None:
        """Close the database; idempotent. Folding the log into the file can wait: what it holds is durable."""
        with contextlib.suppress(apsw.Error):
            self._db.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def documents(self) -> dict[str, str]:
        """The files the run was made from, by name."""
        return dict(self._all("SELECT name, body FROM document ORDER BY name"))

    def run_list(self) -> RunList:
        """The run list as stored."""
        factors = tuple(
            Factor(name, axis, overtravel, bool(hard), bool(stays))
            for name, axis, overtravel, hard, stays in self._all(
                "SELECT name, axis, overtravel, hard, stays FROM factor ORDER BY position"
            )
        )
        width = len(factors)
        names = ", ".join([f'"{f.name}"' for f in factors] + [f'"{f.name}_side"' for f in factors])
        points = (
            Point(row[0], row[1], row[2], row[3 : 3 + width], row[3 + width :])
            for row in self._slices(f"run_index, replication, whole_plot, {names} FROM point")
        )
        return RunList(factors, points, int(self.genesis().data["seed"]))

    def genesis(self) -> Record:
        """The first record: what the run is."""
        for _, record, _, _ in self.chained("seq = 1"):
            return record
        raise RunFileError(f"{self.path} holds no records: it was never finished being created; delete it")

    def records(self, kind: str | None = None) -> Iterator[Record]:
        """Records in order, all or of one kind."""
        where, values = ("kind = ?", (kind,)) if kind else ("1", ())
        return (record for _, record, _, _ in self.chained(where, values))

    def latest(self, kind: str, status: str) -> Record | None:
        """The last record of a kind and status; None if there is none."""
        where = "seq = (SELECT max(seq) FROM record WHERE kind = ? AND status = ?)"
        return next((record for _, record, _, _ in self.chained(where, (kind, status))), None)

    def salvage(self) -> Iterator[Record]:
        """Every record that can still be read one by one, whatever the state of the others."""
        with contextlib.suppress(RunFileError):
            last, _ = self.head()
            for seq in range(1, last + 1):
                with contextlib.suppress(RunFileError):
                    yield from (record for _, record, _, _ in self.chained("seq = ?", (seq,)))

    def chained(self, where: str = "1", values: tuple[object, ...] = ()) -> Iterator[tuple[int, Record, bytes, bytes]]:
        """Rows as (seq, record, previous, hash), in order."""
        for row in self._slices(f"seq, {_COLUMNS}, previous, hash FROM record", where, values):
            yield row[0], Record(*row[1:10]), _bytes(row[10]), _bytes(row[11])

    def head(self) -> tuple[int, bytes]:
        """Number of records and the last one's hash."""
        for seq, own in self._all("SELECT seq, hash FROM record ORDER BY seq DESC LIMIT 1"):
            return seq, _bytes(own)
        return 0, GENESIS

    def holds(self, seq: int, own: bytes) -> bool:
        """Whether there is a record of that number and hash."""
        return bool(self._all("SELECT 1 FROM record WHERE seq = ? AND hash = ?", (seq, own)))

    def verify(self, each: Callable[[Record], object] = lambda _: None) -> None:
        """Check integrity, schema, run list, documents and chain.

        Args:
            each: called with every record, as the chain is followed: a state can be folded in the same pass.

        Raises:
            RunFileError: says what was changed first, and where; `rig verify` lists everything.

        """
        wrong = next(findings(self, thorough=False, each=each), None)
        if wrong is not None:
            raise _edited(self.path, str(wrong))

    def _slices(self, what: str, where: str = "1", values: tuple[object, ...] = ()) -> Iterator[Any]:
        """Rows in order of their key, a slice at a time: no list of them all, and no transaction that stays open.

        Args:
            what: the key, other columns, and the table.
            where: which rows.
            values: for the marks in it.

        """
        key = what.partition(",")[0]
        statement = f"SELECT {what} WHERE {key} >= ? AND ({where}) ORDER BY {key} LIMIT {_SLICE}"
        since = _LOWEST
        while rows := self._all(statement, (since, *values)):
            yield from rows
            last = rows[-1][0]
            if last < since:  # a tree that leads in circles
                raise _unreadable(self.path, ValueError(f"{key} {last} comes after {since - 1}"))
            if len(rows) < _SLICE or last == _HIGHEST:
                return
            since = last + 1

    def _all(self, statement: str, values: tuple[object, ...] = ()) -> list[Any]:
        try:
            return list(self.guarded.rows(statement, values))
        except (apsw.Error, UnicodeDecodeError) as error:
            raise _unreadable(self.path, error) from error


class RunWriter(RunReader):
    """The one connection that writes. Holds an exclusive lock on the run file while it lives."""

    dropped: wal.WalState
    _lock: int
    _vfs: str

    @classmethod
    def open(cls, path: Path, *, vfs: str = "", verified: tuple[int, bytes] | None = None) -> Self:
        """Lock, look at the log, open, verify. Raises `BusyError` or `RunFileError`.

        Args:
            path: the run file.
            vfs: what it lies on.
            verified: the head it had when it was verified a moment ago, which need not be done again while it has it.

        """
        _check_header(path)
        lock = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
        try:
            if not _locked(lock):
                raise BusyError(f"{path} is in use by another controller; `rig status {path}` shows it")
            _renew_log(path, vfs)
            dropped = wal.inspect(path)
            try:
                db = apsw.Connection(str(path), flags=apsw.SQLITE_OPEN_READWRITE, vfs=vfs or None)
                guard(db, writes=True)
                run = cls(path, _checked(path, db))
            except apsw.Error as error:
                raise _unreadable(path, error) from error
            run.dropped = dropped
            run._lock = lock
            run._vfs = vfs
            try:
                if verified is None or run.head() != verified:
                    run.verify()
                run._start()
            except BaseException:
                RunReader.close(run)
                raise
        except BaseException:
            os.close(lock)
            raise
        return run

    def _start(self) -> None:
        try:
            self._db.set_busy_timeout(10_000)
            self._db.set_progress_handler(None)  # from here on it is our own statements on a file that verifies
            self._db.pragma("synchronous", "extra")  # entering WAL mode, which journals its own way, is durable too
            self._db.pragma("journal_mode", "wal")
            self._db.pragma("synchronous", "full")
        except apsw.Error as error:
            raise _not_durable(self.path, error) from error
        self._seq, self._hash = self.head()
        self._pending: list[tuple[int, Record, bytes, bytes]] = []
        self._finished = False
        self._lost: StorageError | None = None
        self.dropped = self._cut_off(self.dropped)
        self._last_word = LastWord(self.path)
        if self._seq > 1:
            self._last_word.say(self._seq, self._hash)

    def _cut_off(self, dropped: wal.WalState) -> wal.WalState:
        """What was dropped, in the light of how many records the last session is known to have written."""
        last = read_last_word(self.path)
        if last is None:
            return dropped
        if self.holds(*last):
            return replace(dropped, lost_commits=0)  # what is cut short at the end had not been acknowledged
        missing = last[0] - self._seq
        damage = f"its last {missing} record(s) are not there" if missing > 0 else f"record {last[0]} is another one"
        return replace(dropped, damage=dropped.damage or damage, lost_commits=max(1, missing))

    def append(self, record: Record, *, commit: bool = True) -> None:
        """Add a record; without `commit` it becomes durable together with the next one that has it.

        Raises:
            StorageError: the record could not be made durable; the run must stop. It may still be found in the file
                later, or become durable with the next commit.

        """
        seq = self._seq + len(self._pending) + 1
        previous = self._pending[-1][3] if self._pending else self._hash
        self._pending.append((seq, record, previous, link(previous, seq, record)))
        if commit:
            self.commit()

    def commit(self) -> None:
        """Make everything appended durable. Raises `StorageError`, also if the file has lost its name."""
        if not self._pending:
            return
        self._must_be_there()
        rows = [(seq, *record.fields(), previous, own) for seq, record, previous, own in self._pending]
        try:
            self._db.execute("BEGIN IMMEDIATE")
            self._db.executemany(_INSERT, rows)
            self._db.execute("COMMIT")
        except apsw.Error as error:
            with contextlib.suppress(apsw.Error):
                self._db.execute("ROLLBACK")
            if isinstance(error, apsw.ConstraintError):
                raise
            raise _not_durable(self.path, error) from error
        self._seq, _, _, self._hash = self._pending[-1]
        self._pending.clear()
        self._last_word.say(self._seq, self._hash)

    def _must_be_there(self) -> None:
        """A file without its name would take a night's records with it when it is closed."""
        if self._lost is None and not is_still_at(self.path, self._lock):
            self._lost = rescue(self.path, self._db)
        if self._lost is not None:
            raise self._lost

    def finish(self, record: Record) -> None:
        """Write the end record with count and head hash, and turn the file into an ordinary one."""
        self.commit()
        body = {**record.data, "records": self._seq, "head": self._hash.hex()}
        try:
            self.append(
                Record(record.session, "end", record.elapsed_s, record.utc_s, status=record.status, body=encode(body))
            )
        except StorageError:
            self._pending.clear()  # what is still written about the failure must not follow an end
            raise
        self._db.set_busy_timeout(200)
        # A reader is looking, or the disk refuses: every record is safe, only the log file stays.
        with contextlib.suppress(apsw.Error, OSError):
            self._db.wal_checkpoint(mode=apsw.SQLITE_CHECKPOINT_TRUNCATE)
            self._db.pragma("synchronous", "extra")
            self._db.pragma("journal_mode", "delete")
            storage_of(self._vfs).sync_folder(self.path.parent)
        self._finished = True

    def close(self) -> None:
        """Close; records not committed are lost, as they would be in a crash."""
        try:
            super().close()
        finally:
            self._last_word.close(finished=self._finished)
            if self._lock >= 0:
                os.close(self._lock)  # after SQLite: closing any descriptor drops its own locks on the file
                self._lock = -1


def create(path: Path, genesis: Genesis, *, elapsed_s: float, utc_s: float, vfs: str = "") -> None:
    """Make a run file: whole and durable under its final name, or not there at all.

    Raises:
        StorageError: the disk refuses.
        RunFileError: something of that name exists.

    """
    if path.exists():
        raise RunFileError(f"{path} exists already; a run is never overwritten")
    part, disk = path.with_name(path.name + ".part"), storage_of(vfs)
    try:
        disk.make_folder(path.parent)
        disk.remove(part)
        db = apsw.Connection(str(part), vfs=vfs or None)
        try:
            _fill(db, genesis, elapsed_s, utc_s)
        finally:
            db.close()
        disk.replace(part, path)
        disk.sync_folder(path.parent)
    except (apsw.Error, OSError) as error:
        for name in (part, part.with_name(part.name + "-journal"), path):
            with contextlib.suppress(OSError):
                disk.remove(name)
        raise StorageError(f"cannot create {path}: {error}. Nothing was moved and nothing is left behind.") from error


def _fill(db: apsw.Connection, genesis: Genesis, elapsed_s: float, utc_s: float) -> None:
    runs = genesis.run_list
    db.pragma("application_id", APPLICATION_ID)
    db.pragma("user_version", SCHEMA_VERSION)
    db.pragma("synchronous", "full")
    db.execute("BEGIN IMMEDIATE")
    for statement in statements([f.name for f in runs.factors]).values():
        db.execute(statement)
    db.executemany("INSERT INTO document VALUES (?, ?)", list(genesis.documents.items()))
    db.executemany(
        "INSERT INTO factor VALUES (?, ?, ?, ?, ?, ?)",
        [(i, f.name, f.axis, f.overtravel, int(f.hard), int(f.stays)) for i, f in enumerate(runs.factors)],
    )
    marks = ", ".join("?" * (3 + 2 * len(runs.factors)))
    db.executemany(
        f"INSERT INTO point VALUES ({marks})",
        ((p.index, p.replication, p.whole_plot, *p.setpoints, *p.sides) for p in runs.points),
    )
    body = {
        "run_id": genesis.run_id,
        "simulated": genesis.simulated,
        "documents": {name: _digest(text) for name, text in genesis.documents.items()},
        "run_list": runs.sha256(),
        "points": len(runs),
        "seed": runs.seed,
        **genesis.about,
    }
    first = Record(0, "run", elapsed_s, utc_s, body=encode(body))
    row = (1, *first.fields(), GENESIS, link(GENESIS, 1, first))
    db.execute(_INSERT, row)
    db.execute("COMMIT")


_READ = apsw.SQLITE_OPEN_READONLY | apsw.SQLITE_OPEN_URI
_COPY = (
    ": go on with a copy of it from before, which `rig verify` finds whole, or with what `rig verify FILE --restore "
    "NEW.sqlite` makes of it"
)
_WAY_FORWARD = (
    "Nothing was changed now. Keep the file; `rig export FILE --salvage --out DATA.csv` saves what can still "
    "be read, `rig verify FILE --restore NEW.sqlite` the beginning that is proven; that, or a copy from before the "
    "damage, can be resumed."
)


def _bytes(value: object) -> bytes:
    """A hash as stored; what is none is one of nothing."""
    return value if isinstance(value, bytes) else b""


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def _check_header(path: Path) -> None:
    """Refuse what is no run file before SQLite touches it."""
    try:
        with path.open("rb") as file:
            start = file.read(100)
    except FileNotFoundError:
        raise UsageError(f"there is no run file {path}") from None
    except OSError as error:
        raise UsageError(f"{path} cannot be read: {error.strerror}") from error
    if not start.startswith(b"SQLite format 3\0") or len(start) < 100:
        raise UsageError(f"{path} is not a run file (not an SQLite database), or its beginning is damaged{_COPY}")
    if int.from_bytes(start[68:72], "big") != APPLICATION_ID:
        raise UsageError(f"{path} is not a run file (an SQLite database of another program), or damaged{_COPY}")


def _locked(descriptor: int) -> bool:
    """Take the lock; somebody who only looks whether it is taken holds it for an instant, so try for half a second."""
    clock = RealClock()
    for _ in range(10):
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            clock.sleep(0.05)
        else:
            return True
    return False


def _opened(path: Path, uri: str) -> apsw.Connection:
    db = apsw.Connection(uri, flags=_READ)
    db.set_busy_timeout(2000)
    guard(db, writes=False)
    return _checked(path, db)


def _size(path: Path) -> int:
    """Bytes of a run file and its log."""
    files = (path, path.with_name(path.name + "-wal"))
    return sum(file.stat().st_size for file in files if file.exists())


def _rolled_back(path: Path) -> bool:
    """Let SQLite undo a half-written change of the file's mode; False if there is none, or somebody is at work.

    Entering and leaving WAL mode is journalled, and a connection that only reads cannot finish with a journal that a
    power cut left.
    """
    if not path.with_name(path.name + "-journal").exists():
        return False
    lock = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    try:
        if not _locked(lock):
            return False
        db = apsw.Connection(str(path), flags=apsw.SQLITE_OPEN_READWRITE)
        try:
            db.execute("SELECT count(*) FROM sqlite_master").fetchall()
        finally:
            db.close()
    except apsw.Error:
        return False
    finally:
        os.close(lock)
    return not path.with_name(path.name + "-journal").exists()


def _checked(path: Path, db: apsw.Connection) -> apsw.Connection:
    """A connection to a file whose tables are those of a run file. SQLite opens lazily: this is the first look."""
    version = db.pragma("user_version")
    if version != SCHEMA_VERSION:
        raise RunFileError(
            f"{path} has run-file format {version}, this program reads format {SCHEMA_VERSION}: "
            f"use the version of rig that wrote it; if this one did, it is damaged{_COPY}"
        )
    strange = strange_tables(Guarded(db, lambda: _size(path)))
    if strange is not None:
        raise _edited(path, strange)
    return db


def _edited(path: Path, what: str) -> RunFileError:
    return RunFileError(
        f"{path} was edited or damaged: {what}. `rig verify {path}` lists everything that is wrong. {_WAY_FORWARD}"
    )


def _unreadable(path: Path, error: Exception) -> RunFileError:
    return RunFileError(f"{path} is damaged and cannot be read ({error}). {_WAY_FORWARD}")


def _not_durable(path: Path, error: Exception) -> StorageError:
    return StorageError(
        f"cannot write to {path}: {error}. Everything up to the last observation is safe. "
        f"Free space or mend the disk, then: rig resume {path}"
    )


def _renew_log(path: Path, vfs: str) -> None:
    """Write the log over itself before anything is built on it: a failed fsync may have left it in memory only.

    Raises `StorageError`: nothing can be made durable.
    """
    log = path.with_name(path.name + "-wal")
    try:
        if log.exists():
            storage_of(vfs).rewrite(log)
    except OSError as error:
        raise _not_durable(path, error) from error
