"""Opening a run file: checks before anything is read from it, and the errors if it cannot be read."""

from __future__ import annotations

import contextlib
import fcntl
import os
from collections.abc import Iterator
from pathlib import Path

import apsw

from rig.drivers.clock import RealClock
from rig.errors import RunFileError, UsageError
from rig.files.regular import open_regular
from rig.procedures.present.shell import shell_word
from rig.run_file.bodies import ContentsError
from rig.run_file.last_word import head_path
from rig.run_file.read.beside import Alone, alone, check_journal, has_log
from rig.run_file.saved import saved_words
from rig.run_file.schema import APPLICATION_ID, SCHEMA_VERSION, Guarded, guard, strange_tables

_READ_ONLY = apsw.SQLITE_OPEN_READONLY | apsw.SQLITE_OPEN_URI
_COPY = (
    ": go on with a copy of it from before, which `rig verify` finds whole, or with what `rig verify FILE --restore "
    "NEW.sqlite` makes of it"
)
_NOTHING_CHANGED = (
    "Nothing was changed now. Keep the file; `rig export FILE --salvage --out DATA.csv` saves what can still "
    "be read, `rig verify FILE --restore NEW.sqlite` the beginning that is proven; that, or a copy from before the "
    "damage, can be resumed."
)


def _way_forward(path: Path) -> str:
    return f"{saved_words(path)}{_NOTHING_CHANGED}"


def _copy(path: Path) -> str:
    saved = saved_words(path)
    return f". {saved[:-2]}, or{_COPY[1:]}" if saved else _COPY


def check_header(path: Path) -> None:
    """Refuse a file that is no run file before SQLite opens it."""
    try:
        with open_regular(path) as file:
            start = file.read(100)
    except FileNotFoundError:
        raise UsageError(f"there is no run file {path}") from None
    except OSError as error:
        raise UsageError(f"{path} cannot be read: {error.strerror}") from error
    if not start.startswith(b"SQLite format 3\0") or len(start) < 100:
        raise UsageError(f"{path} is not a run file (not an SQLite database), or its beginning is damaged{_copy(path)}")
    if int.from_bytes(start[68:72], "big") != APPLICATION_ID:  # its place by SQLite's file format
        raise UsageError(f"{path} is not a run file (an SQLite database of another program), or damaged{_copy(path)}")


_WAL_MODE = b"\x02"
"""Value in a database's header if a log of the same name may belong to it."""


def check_name(path: Path) -> None:
    """Refuse a second name (hard link) of a run in progress: its log has the first name. Raises `UsageError`."""
    if os.stat(path).st_nlink < 2 or has_log(path) or head_path(path).exists():
        return
    with path.open("rb") as file:
        if file.read(20)[18:19] != _WAL_MODE:
            return
    own = os.stat(path).st_ino
    others: list[Path] = []  # a folder may be entered and not listed
    with contextlib.suppress(OSError):
        others = [other for other in sorted(path.absolute().parent.iterdir()) if other.lstat().st_ino == own]
    names = ", ".join(str(other) for other in others if other != path.absolute()) or "somewhere else"
    raise UsageError(
        f"{path} is a second name (hard link) of a run that is not finished, and what was observed last goes by the "
        f"first: {names}. Use that one, or remove this name"
    )


def locked(descriptor: int) -> bool:
    """Take the lock. A program that only tests the lock holds it for a moment, so try for half a second."""
    clock = RealClock()
    for _ in range(10):
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            clock.sleep(0.05)
        else:
            return True
    return False


def opened_to_read(path: Path, uri: str) -> apsw.Connection:
    """A read-only connection. Raises `apsw.Error` or `RunFileError`."""
    db = apsw.Connection(uri, flags=_READ_ONLY)
    db.set_busy_timeout(2000)  # milliseconds; chosen
    guard(db, writes=False)
    return checked(path, db)


def by_itself(path: Path) -> Alone | None:
    """Contents of a run file without its log; None if there is no log, or the file alone cannot be read."""
    if not has_log(path):
        return None
    with contextlib.suppress(apsw.Error, RunFileError, UnicodeDecodeError, ValueError, TypeError):
        db = opened_without_log(path)
        try:
            return alone(path, Guarded(db, lambda: size_of(path)))
        finally:
            db.close()
    return None


def opened_without_log(path: Path) -> apsw.Connection:
    """A connection that ignores files beside the run file. Raises as `opened_to_read`."""
    # For an immutable file SQLite looks for neither log nor lock.
    return opened_to_read(path, f"{path.absolute().as_uri()}?mode=ro&immutable=1")


def size_of(path: Path) -> int:
    """Size of a run file and its log, bytes."""
    found = 0
    for name in (str(path), f"{path}-wal"):
        with contextlib.suppress(FileNotFoundError):
            found += os.stat(name).st_size
    return found


def rolled_back(path: Path) -> bool:
    """Let SQLite undo a half-written change of the file's mode; False if there is none, or another program is
    writing.

    Entering and leaving WAL mode uses a journal, and a read-only connection cannot apply a journal left by a
    power cut. Raises `ForeignFileError` if the journal belongs to another file.
    """
    check_journal(path)
    if not path.with_name(path.name + "-journal").exists():
        return False
    lock = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    try:
        if not locked(lock):
            return False
        db = apsw.Connection(str(path), flags=apsw.SQLITE_OPEN_READWRITE)
        db.config(apsw.SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, 1)  # only the journal is undone; a log stays as it is
        try:
            db.execute("SELECT count(*) FROM sqlite_master").fetchall()
        finally:
            db.close()
    except apsw.Error:
        return False
    finally:
        os.close(lock)
    return not path.with_name(path.name + "-journal").exists()


def checked(path: Path, db: apsw.Connection) -> apsw.Connection:
    """A connection to a file with the tables of a run file. SQLite opens lazily: this is the first access."""
    version = db.pragma("user_version")
    if version != SCHEMA_VERSION:
        raise RunFileError(
            f"{path} has run-file format {version}, this program reads format {SCHEMA_VERSION}: "
            f"use the version of rig that wrote it; if this one did, it is damaged{_copy(path)}"
        )
    strange = strange_tables(Guarded(db, lambda: size_of(path)))
    if strange is not None:
        raise edited(path, strange)
    return db


def edited(path: Path, what: str) -> RunFileError:
    """The error for a file that was changed by a person or another program."""
    return RunFileError(
        f"{path} was edited or damaged: {what}. `rig verify {shell_word(path)}` lists everything that is wrong. "
        f"{_way_forward(path)}"
    )


def makes_no_sense(path: Path, error: BaseException) -> RunFileError:
    """The error for a file with the tables and hashes of a run file, but with contents that this program does not
    write.
    """
    if not isinstance(error, ContentsError):
        error = ContentsError(f"{type(error).__name__}: {str(error)[:200]}")
    return RunFileError(
        f"{path} holds what makes no sense in a run file: {error}. It was edited, or another version of rig wrote it. "
        f"{_way_forward(path)}"
    )


@contextlib.contextmanager
def sensible(path: Path) -> Iterator[None]:
    """Context for code that uses contents of a run file: adds the file's name to a `ContentsError`."""
    try:
        yield
    except ContentsError as error:
        raise makes_no_sense(path, error) from error


def unreadable(path: Path, error: Exception) -> RunFileError:
    """The error for a file that SQLite cannot read."""
    return RunFileError(f"{path} is damaged and cannot be read ({error}). {_way_forward(path)}")
