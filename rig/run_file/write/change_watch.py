"""Detection of changes to a run file, or its log, by other programs than its writer.

SQLite assumes that the files agree with its memory. A log that is cut, removed or overwritten is not noticed until
another program reads it. While a run writes, nobody else may write. So size, time of change and identity of both
files must be the same as after the last commit.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import apsw

from rig.run_file.schema import Stored

MOVED = "it was moved, deleted or replaced"
_Seen = tuple[int, int, int, int]
"""Device, inode, size and time of change."""


def _look(file: str | int) -> _Seen | None:
    """Identity, size and time of change of a file; None if it is missing. Raises OSError if it cannot be read.

    Args:
        file: its path or, in half the time, its descriptor.

    """
    try:
        found = os.stat(file)
    except (FileNotFoundError, NotADirectoryError):
        return None
    return found.st_dev, found.st_ino, found.st_size, found.st_mtime_ns


class ChangeWatch:
    """Watches a run file and its log.

    Args:
        path: the run file.
        descriptor: it, opened: the file that `path` has to name.

    """

    def __init__(self, path: Path, descriptor: int) -> None:
        self._paths = {"it": str(path), "its log": f"{path}-wal"}
        # The file by its descriptor, which cannot name another one; the log by its path, since SQLite makes it anew.
        self._files: dict[str, str | int] = {**self._paths, "it": descriptor}
        self._seen: dict[str, _Seen | None] = {}
        own = os.fstat(descriptor)
        self._own = own.st_dev, own.st_ino
        self.note()

    def note(self) -> None:
        """Note the present state as the writer's."""
        for what, file in self._files.items():
            try:
                self._seen[what] = _look(file)
            except OSError:
                self._seen.pop(what, None)  # a folder that cannot be read is no evidence

    def changed(self) -> str:
        """The change by another program since then: the end of a sentence, "" if none.

        It is `MOVED` if the path no longer names the file that is open. A folder that cannot be read at the moment is
        no evidence; writing will show its defect.
        """
        for what, path in self._paths.items():
            try:
                now = _look(path)
            except OSError:
                continue
            if what == "it" and (now is None or now[:2] != self._own):
                return MOVED
            if what not in self._seen or now == self._seen[what]:
                continue
            before = self._seen[what]
            if now is None:
                return f"{what} was removed"
            if before is not None and now[:2] == before[:2]:
                return f"{what} was {'cut' if now[2] < before[2] else 'changed by another program'}"
            return f"{what} was replaced"
        return ""


MOST_BYTES = 128 << 20
"""Maximum size of a run file that is also kept in memory, bytes. Runs of a night have a tenth of it."""
_TOGETHER = 256
"""Records added at once; chosen."""


class Mirror:
    """A copy of a run file in memory, for the case that the file is damaged while it is open.

    Records are added to it many at a time, and those left over when it is asked for: one alone takes three times as
    long.

    Args:
        db: the file, opened.
        insert: the statement that adds a record.

    """

    def __init__(self, db: apsw.Connection, insert: str) -> None:
        self._insert = insert
        self._rows: list[tuple[Stored, ...]] = []
        self._db: apsw.Connection | None = None
        if _bytes(db) > MOST_BYTES:
            return
        self._db = apsw.Connection(":memory:")
        with self._db.backup("main", db, "main") as backup:
            backup.step()

    @property
    def db(self) -> apsw.Connection | None:
        """The copy, with every record that was added; None if the run is too large for one."""
        if self._db is not None and self._rows:
            with self._db:
                self._db.executemany(self._insert, self._rows)
            self._rows.clear()
        return self._db

    def add(self, rows: Sequence[tuple[Stored, ...]]) -> None:
        """Add the records that were just committed."""
        if self._db is None:
            return
        self._rows += rows
        if len(self._rows) >= _TOGETHER:
            db = self.db
            if db is not None and _bytes(db) > MOST_BYTES:
                self.close()

    def close(self) -> None:
        """Let it go."""
        self._rows.clear()
        if self._db is not None:
            self._db.close()
            self._db = None


def _bytes(db: apsw.Connection) -> int:
    return int(db.pragma("page_count")) * int(db.pragma("page_size"))
