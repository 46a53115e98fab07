"""Temporary files of a folder, and a lock on a folder for commands that change the same files in turn.

A file is written as `.rig-PID-RANDOM.tmp` and renamed when it is complete. A command that is killed before leaves it;
the next command that writes in the folder removes it.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
import re
import secrets
from collections.abc import Iterator
from pathlib import Path
from typing import IO

from rig.errors import UsageError

_NAME = re.compile(r"\.rig-(\d{1,10})-[0-9a-f]{8}\.tmp")
_LOCK = ".rig-lock"
_NOT_ON_FOLDERS = (errno.EBADF, errno.EINVAL, errno.ENOLCK, errno.EOPNOTSUPP)
"""Errors of file systems that lock no folder, such as NFS."""


def temporary_in(folder: Path) -> Path:
    """A new name of fixed length: the final name may have the maximum length."""
    return folder / f".rig-{os.getpid()}-{secrets.token_hex(4)}.tmp"


@contextlib.contextmanager
def open_temporary(path: Path, mode: int = 0o666) -> Iterator[IO[bytes]]:
    """Make a temporary file, locked as long as it is open, so that `sweep` of another machine leaves it."""
    made = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, mode)
    with os.fdopen(made, "wb") as file:
        with contextlib.suppress(OSError):  # without locks, `sweep` still knows the process
            fcntl.flock(made, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield file


def sweep(folder: Path) -> None:
    """Remove temporary files of dead processes.

    A file stays if its process lives here, or if somebody holds its lock: a process of another machine, or of another
    container, has a number that says nothing here.
    """
    with contextlib.suppress(OSError), os.scandir(folder) as found:
        for entry in found:
            named = _NAME.fullmatch(entry.name)
            if named and not _lives(int(named[1])) and entry.is_file(follow_symlinks=False):
                with contextlib.suppress(OSError):
                    _remove_unlocked(entry.path)


def _lives(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except OSError:  # of another user
        return True
    return True


def _remove_unlocked(path: str) -> None:
    file = os.open(path, os.O_RDWR | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK)
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        os.unlink(path)
    finally:
        os.close(file)


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold the only lock of a folder; wait while another command has it. It ends with the process in any case.

    The lock is on the folder itself. Where the file system has no locks on folders, it is on a file in it.

    Raises:
        UsageError: the file system has no locks, or the folder cannot be opened.
    """
    try:
        held = _lock(folder)
    except OSError as error:
        raise UsageError(
            f"{folder} cannot be locked against another command: {error.strerror}; use a folder of a local disk"
        ) from error
    try:
        yield
    finally:
        os.close(held)


def _lock(folder: Path) -> int:
    held = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        fcntl.flock(held, fcntl.LOCK_EX)
    except OSError as error:
        os.close(held)
        if error.errno not in _NOT_ON_FOLDERS:
            raise
        held = os.open(folder / _LOCK, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
        try:
            fcntl.flock(held, fcntl.LOCK_EX)
        except OSError:
            os.close(held)
            raise
    return held


def sync_folder(folder: Path) -> None:
    """Make the names in a folder durable."""
    opened = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        os.fsync(opened)
    finally:
        os.close(opened)
