"""A run file that was moved, deleted or replaced while it was written: noticed, and what was in it saved."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

import apsw

from rig.errors import StorageError
from rig.run_file.chain import Record, encode, link
from rig.run_file.schema import INSERT_RECORD

RESCUED = "rescued"
"""Status of the event that says in which file a run goes on."""


def is_still_at(path: Path, descriptor: int) -> bool:
    """Whether `path` still names the file that is open as `descriptor`.

    A folder that cannot be looked at just now is no evidence: writing tells what is wrong with it.
    """
    try:
        there = os.stat(path)
    except (FileNotFoundError, NotADirectoryError):
        return False
    except OSError:
        return True
    return os.path.samestat(there, os.fstat(descriptor))


def rescue(path: Path, db: apsw.Connection) -> StorageError:
    """Copy what a run file held that has lost its name, before the last to hold it open lets it go.

    Returns:
        what to raise: what happened, where the copy is, what to do next.

    """
    happened = f"{path} was moved, deleted or replaced while the run was writing to it"
    copy = path.with_name(f"{path.stem}-rescued-{os.getpid()}.sqlite")
    try:
        copy.parent.mkdir(parents=True, exist_ok=True)
        os.close(os.open(copy, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o644))
        to = apsw.Connection(str(copy))
        try:
            with to.backup("main", db, "main") as backup:
                backup.step()
        finally:
            to.close()
    except (OSError, apsw.Error) as error:
        with contextlib.suppress(OSError):
            copy.unlink(missing_ok=True)
        return StorageError(f"{happened}, and no copy could be made ({error}): look for the file that was moved")
    with contextlib.suppress(apsw.Error):
        _hand_over(db, copy)
    return StorageError(f"{happened}. Everything up to the last observation is in {copy}; then: rig resume {copy}")


def _hand_over(db: apsw.Connection, copy: Path) -> None:
    """Leave word in the file that lost its name where the run goes on, so that nobody carries on with both.

    Its log stays behind under the old name: what is in there goes into the file, and the log is emptied, lest it be
    taken for that of another file which gets the name.
    """
    (row,) = db.execute("SELECT seq, session, elapsed_s, utc_s, hash FROM record ORDER BY seq DESC LIMIT 1")
    seq, session, elapsed_s, utc_s, head = row
    record = Record(session, "event", elapsed_s, utc_s, status=RESCUED, body=encode({"to": str(copy.absolute())}))
    values = (seq + 1, *record, head, link(head, seq + 1, record))
    db.execute(INSERT_RECORD, values)
    db.wal_checkpoint(mode=apsw.SQLITE_CHECKPOINT_TRUNCATE)
