"""`RUN.head` beside a run file in progress: number of records and hash of the last one.

A log that was cut exactly between two commits, or removed, looks like a complete shorter log. This small file is
written after every commit and never synced, so it may be behind the run file but never ahead of it. If it counts more
records than the run file has, records were lost or removed. A finished run has count and hash in its end record
instead.
"""

from __future__ import annotations

import contextlib
import os
import stat
from pathlib import Path

from rig.files.regular import open_regular, real_path
from rig.files.temporary import temporary_in

_SIZE = 8 + 32


def head_path(run: Path) -> Path:
    """Path of `RUN.head` of a run file."""
    return real_path(run).with_suffix(".head")


def read_last_word(run: Path) -> tuple[int, bytes] | None:
    """Number of records and hash of the last one; None if there is no valid file."""
    try:
        with open_regular(head_path(run)) as file:
            data = file.read(_SIZE + 1)
    except OSError:
        return None
    return (int.from_bytes(data[:8], "big"), data[8:]) if len(data) == _SIZE else None


def _opened(path: Path) -> int:
    """Open the file for writing. A link, or a file with a second name, is replaced by a new file."""
    flags = os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK
    with contextlib.suppress(OSError):
        descriptor = os.open(path, flags, 0o644)
        found = os.fstat(descriptor)
        if stat.S_ISREG(found.st_mode) and found.st_nlink == 1:
            return descriptor
        os.close(descriptor)
    said = b""
    with contextlib.suppress(OSError), open_regular(path) as file:
        said = file.read(_SIZE)
    fresh = temporary_in(path.parent)
    descriptor = os.open(fresh, flags | os.O_EXCL, 0o644)
    try:
        os.write(descriptor, said)
        os.replace(fresh, path)
    except OSError:
        os.close(descriptor)
        with contextlib.suppress(OSError):
            fresh.unlink()
        raise
    return descriptor


class LastWord:
    """Writes `RUN.head`. A failure to write it never disturbs a run."""

    def __init__(self, run: Path) -> None:
        self._path = head_path(run)
        self._file = -1
        with contextlib.suppress(OSError):
            self._file = _opened(self._path)

    def say(self, count: int, head: bytes) -> None:
        """Write it in one write within a sector, so that it is never torn."""
        if self._file >= 0:
            try:  # noqa: SIM105 - at every commit, and `suppress` takes as long as the rest
                os.pwrite(self._file, count.to_bytes(8, "big") + head, 0)
            except OSError:
                pass

    def close(self, *, finished: bool) -> None:
        """Close it, and remove it if the run is finished."""
        if self._file >= 0:
            os.close(self._file)
            self._file = -1
        if finished:
            with contextlib.suppress(OSError):
                self._path.unlink(missing_ok=True)
