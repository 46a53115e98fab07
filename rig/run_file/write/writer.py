"""Writing a run file, always by a single connection.

The write-ahead log runs with synchronous=FULL: a commit that returned survives a power cut. Triggers refuse UPDATE and
DELETE. Records are chained by hash (`rig.run_file.chain`). A partial unique index prevents a second accepted
observation of a point in one whole plot. A finished run leaves WAL mode and is one ordinary file.
"""

from __future__ import annotations

import contextlib
import json
import os
from dataclasses import replace
from pathlib import Path
from typing import Self

import apsw

from rig.errors import BusyError, RunFileError, StorageError
from rig.files.regular import real_path
from rig.procedures.present.shell import shell_word
from rig.run_file import wal
from rig.run_file.chain import Record, StoredRow, encode, link
from rig.run_file.damage.audit import findings
from rig.run_file.events.sessions import Ended
from rig.run_file.last_word import LastWord, read_last_word
from rig.run_file.read.beside import Alone, check_journal, foreign_log
from rig.run_file.read.reader import RunReader
from rig.run_file.read.safe_opening import (
    by_itself,
    check_header,
    check_name,
    checked,
    locked,
    opened_to_read,
    unreadable,
)
from rig.run_file.schema import INSERT_RECORD, guard
from rig.run_file.storage import storage_of
from rig.run_file.write.change_watch import MOVED, ChangeWatch, Mirror
from rig.run_file.write.rescue import rescue


class RunWriter(RunReader):
    """The one connection that writes. Holds an exclusive lock on the run file while it lives."""

    only_reads = False

    dropped: wal.WalState
    _lock: int
    _vfs: str

    @classmethod
    def open(cls, path: Path, *, vfs: str = "", verified: tuple[int, bytes] | None = None) -> Self:
        """Lock, inspect the log, open, verify. Raises `BusyError` or `RunFileError`.

        Args:
            path: the run file.
            vfs: name of its VFS.
            verified: head at a verification a moment ago; the file is not verified again while it has this
                head.

        """
        path = real_path(path)
        check_header(path)
        lock = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
        try:
            if not locked(lock):
                raise BusyError(f"{path} is in use by another controller; `rig status {shell_word(path)}` shows it")
            # Under the lock, in this order: the file alone is read before SQLite joins a log to it, and the log is
            # read before SQLite opens it, because opening silently drops bad frames.
            check_name(path)
            check_journal(path)
            alone = by_itself(path)
            _renew_log(path, vfs)
            dropped = wal.inspect(path)
            run = cls._checked(path, alone, _connected(path, vfs, alone))
            run.dropped = dropped
            run._lock = lock
            run._vfs = vfs
            try:
                if verified is None or run.head() != verified:
                    run.verify()
                # Only a verified log may be written into the file.
                run._db.config(apsw.SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, 0)
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
            self._db.set_progress_handler(None)  # from here on only our own statements run, on a verified file
            self._db.pragma("synchronous", "extra")  # entering WAL mode uses a journal of its own; it is durable too
            self._db.pragma("journal_mode", "wal")
            self._db.pragma("synchronous", "full")
        except apsw.Error as error:
            raise _not_durable(self.path, error) from error
        self._seq, self._hash = self.head()
        self._pending: list[StoredRow] = []
        self._finished = False
        self._lost: StorageError | None = None
        self._mirror = Mirror(self._db, INSERT_RECORD)
        self.dropped = self._cut_off(self.dropped)
        self._last_word = LastWord(self.path)
        if self._seq > 1 and not self.dropped.lost_commits:  # known to be lost, not yet recorded
            self._last_word.say(self._seq, self._hash)
        self._vigil = ChangeWatch(self.path, self._lock)

    def _cut_off(self, dropped: wal.WalState) -> wal.WalState:
        """The dropped records, given the number that the last session is known to have written."""
        last = read_last_word(self.path)
        if last is None:
            return dropped
        if self.holds(*last):
            return replace(dropped, lost_commits=0)  # an incomplete frame at the end had not been acknowledged
        missing = last[0] - self._seq
        damage = f"its last {missing} record(s) are not there" if missing > 0 else f"record {last[0]} is another one"
        return replace(dropped, damage=dropped.damage or damage, lost_commits=max(1, missing))

    @property
    def written(self) -> tuple[int, bytes]:
        """Number of durable records, and hash of the last one."""
        return self._seq, self._hash

    def append(self, record: Record, *, commit: bool = True) -> None:
        """Add a record; without `commit` it becomes durable together with the next committed one.

        Raises:
            StorageError: the record could not be made durable; the run must stop. It may still be found in the file
                later, or become durable with the next commit.

        """
        seq = self._seq + len(self._pending) + 1
        previous = self._pending[-1][-1] if self._pending else self._hash
        self._pending.append((seq, *record, previous, link(previous, seq, record)))
        if commit:
            self.commit()

    def commit(self) -> None:
        """Make everything appended durable. Raises `StorageError`, also if file or log were changed by others."""
        if not self._pending:
            return
        self._must_be_there()
        rows = self._pending
        try:
            if len(rows) == 1:  # nearly always: a transaction of one statement
                self._db.execute(INSERT_RECORD, rows[0])
            else:
                self._db.execute("BEGIN IMMEDIATE")
                self._db.executemany(INSERT_RECORD, rows)
                self._db.execute("COMMIT")
        except apsw.Error as error:
            with contextlib.suppress(apsw.Error):
                self._db.execute("ROLLBACK")
            if isinstance(error, apsw.ConstraintError):  # a second acceptance of a point: a defect of this program
                raise
            with contextlib.suppress(apsw.Error):
                # A COMMIT also fails if only the checkpoint after it failed. The records are then in the log,
                # and must not be written again with later records about the failure.
                if self.head() == (rows[-1][0], rows[-1][-1]):
                    self._committed()
            raise _not_durable(self.path, error) from error
        self._committed()

    def _committed(self) -> None:
        self._mirror.add(self._pending)
        self._seq, *_, self._hash = self._pending[-1]
        self._pending.clear()
        self._vigil.note()
        self._last_word.say(self._seq, self._hash)  # last: it may be behind the file, never ahead of it

    def _must_be_there(self) -> None:
        """Copy the contents of a file that was moved, deleted, replaced or changed by others to a safe place."""
        if self._lost is None:
            changed = self._vigil.changed()
            if changed and (changed == MOVED or not self._holds_all()):
                self._lost = self._rescued(changed)
            elif changed:
                self._vigil.note()  # only touched, contents unchanged
        if self._lost is not None:
            raise self._lost

    def _rescued(self, happened: str) -> StorageError:
        return rescue(self.path, happened, [self._db, self._mirror.db], (self._seq, self._hash))

    def _holds_all(self) -> bool:
        """Whether file and log, read again from disk, hold every record that was written."""
        try:
            with RunReader(self.path, opened_to_read(self.path, f"{self.path.absolute().as_uri()}?mode=ro")) as fresh:
                return fresh.head() == (self._seq, self._hash) and next(findings(fresh, thorough=False), None) is None
        except (apsw.Error, RunFileError, OSError):
            return False

    def finish(self, record: Record) -> None:
        """Write the end record with count and head hash, turn the file into an ordinary one, and read it back.

        Raises:
            StorageError: the end could not be made durable, or the file does not hold what was written into it.

        """
        self.commit()
        body = {**json.loads(record.body), "records": self._seq, "head": self._hash.hex()}
        try:
            self.append(
                Record(
                    record.session, Ended.kind, record.elapsed_s, record.utc_s, status=record.status, body=encode(body)
                )
            )
        except StorageError:
            if self._pending:
                self._pending.clear()  # records about the failure must not follow an end record
                raise
            # The end record is written; only the checkpoint failed, which is repeated below.
        self.settle()

    def correct(self, record: Record, *, ended: bool) -> None:
        """Add a correction, also after the end record; the file of an ended run is an ordinary one again then.

        Raises:
            StorageError: it could not be made durable, or the file does not hold what was written into it.

        """
        self.append(record)
        if ended:
            self.settle()

    def settle(self) -> None:
        """Turn the file into an ordinary one, and read it back. Raises `StorageError` if it holds something else."""
        self._db.set_busy_timeout(200)  # milliseconds: somebody may read for long, and the end waits for nobody
        # A reader is open, or the disk refuses: every record is safe, only the log file remains.
        with contextlib.suppress(apsw.Error, OSError):
            self._db.wal_checkpoint(mode=apsw.SQLITE_CHECKPOINT_TRUNCATE)
            self._db.pragma("synchronous", "extra")
            self._db.pragma("journal_mode", "delete")
            storage_of(self._vfs).sync_folder(self.path.parent)
        if not self._holds_all():
            self._lost = self._rescued("it does not hold what was written into it")
            raise self._lost
        self._finished = True

    def close(self) -> None:
        """Close; uncommitted records are lost, as in a crash."""
        try:
            if self._lost is None and self._vigil.changed():  # the log may belong to another file
                self._db.config(apsw.SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, 1)
            super().close()
        finally:
            self._last_word.close(finished=self._finished)
            self._mirror.close()
            if self._lock >= 0:
                os.close(self._lock)  # after SQLite: closing any descriptor drops its own locks on the file
                self._lock = -1


def _connected(path: Path, vfs: str, alone: Alone | None) -> apsw.Connection:
    """A writing connection. By default it leaves the log unchanged when it is closed.

    Raises:
        RunFileError: this is no run file, or a file beside it belongs to another one.

    """
    try:
        db = apsw.Connection(str(path), flags=apsw.SQLITE_OPEN_READWRITE, vfs=vfs or None)
        db.config(apsw.SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, 1)
        guard(db, writes=True)
        return checked(path, db)
    except (apsw.Error, RunFileError) as error:
        if alone is not None and isinstance(error, apsw.CorruptError | apsw.NotADBError | RunFileError):
            raise foreign_log(path, alone.records, "cannot be read") from error
        if isinstance(error, RunFileError):
            raise
        raise unreadable(path, error) from error


def _renew_log(path: Path, vfs: str) -> None:
    """Rewrite the log in place before it is used: after a failed fsync it may exist only in memory.

    Raises `StorageError`: nothing can be made durable.
    """
    log = path.with_name(path.name + "-wal")
    try:
        if log.exists():
            storage_of(vfs).rewrite(log)
    except OSError as error:
        raise _not_durable(path, error) from error


def _not_durable(path: Path, error: Exception) -> StorageError:
    return StorageError(
        f"cannot write to {path}: {error}. Everything up to the last observation is safe. "
        f"Free space or mend the disk, then: rig resume {shell_word(path)}"
    )
