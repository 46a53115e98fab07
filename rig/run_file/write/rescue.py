"""Rescue of a run file that was moved, deleted, replaced or damaged while it was written: its contents are copied."""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

import apsw

from rig.errors import RigError, StorageError
from rig.procedures.present.shell import shell_word
from rig.run_file.chain import Record, encode, link
from rig.run_file.damage.audit import findings
from rig.run_file.events.sessions import Rescued
from rig.run_file.read.reader import RunReader
from rig.run_file.schema import INSERT_RECORD


def rescue(
    path: Path, happened: str, sources: Sequence[apsw.Connection | None], head: tuple[int, bytes]
) -> StorageError:
    """Copy the contents of a run file before the last open connection is closed.

    Args:
        path: the run file.
        happened: what happened to it; the end of a sentence.
        sources: connections that may still have the contents, the file's own first; None for a missing one.
        head: number of records and hash of the last one, which a copy must have.

    Returns:
        the error to raise: what happened, where the copy is, what to do next.

    """
    what = f"{path}: while the run was writing, {happened}"
    own = sources[0]
    if own is not None:  # closing it would write the rest of the log over a file that may be sound
        own.config(apsw.SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, 1)
    why = "nothing could be read"
    for copy in _places(path):
        for source in (one for one in sources if one is not None):
            try:
                _copy(source, copy, head)
            except (OSError, apsw.Error, RigError) as error:
                why = str(error)
                continue
            if source is own:
                with contextlib.suppress(apsw.Error):
                    own.config(apsw.SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, 0)
                    _hand_over(own, copy)
            return StorageError(
                f"{what}. Everything up to the last observation is in {copy}; then: rig resume {shell_word(copy)}"
            )
    return StorageError(
        f"{what}, and no copy could be made ({why}): look for the file that was moved, or see what "
        f"`rig verify {shell_word(path)} --restore NEW.sqlite` finds"
    )


def _places(path: Path) -> Iterator[Path]:
    """Folders for a copy: beside the file, the folder of temporary files, the current folder."""
    name = f"{path.stem}-rescued-{os.getpid()}.sqlite"
    state = os.environ.get("STATE_DIRECTORY", "").partition(":")[0]  # temporary files of a service are deleted with it
    folders = [path.parent, *([Path(state)] if state else []), Path(tempfile.gettempdir()), Path.cwd()]
    yield from (folder / name for folder in dict.fromkeys(folders))


def _copy(source: apsw.Connection, copy: Path, head: tuple[int, bytes]) -> None:
    """Copy a database. Raises OSError, `apsw.Error` or `RigError` if this fails or the copy does not verify."""
    copy.parent.mkdir(parents=True, exist_ok=True)
    os.close(os.open(copy, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o644))  # never over an earlier rescue
    try:
        source.pragma("shrink_memory")  # SQLite's memory may differ from the file
        to = apsw.Connection(str(copy))
        try:
            with to.backup("main", source, "main") as backup:
                backup.step()
        finally:
            to.close()
        with RunReader.open(copy) as run:
            # SQLite copies damaged pages silently: only a copy that verifies counts.
            wrong = next(findings(run, thorough=True), None)
            if wrong is not None or run.head() != head:
                raise OSError(f"the file was damaged: {wrong or 'it ends otherwise'}")
    except (OSError, apsw.Error, RigError):
        with contextlib.suppress(OSError):
            copy.unlink(missing_ok=True)
        raise


def _hand_over(db: apsw.Connection, copy: Path) -> None:
    """Record in the old file where the run continues, so that nobody continues both.

    Its log keeps the old name. The log is written into the file and emptied, so that it is not taken for the log of
    another file that gets this name.
    """
    (row,) = db.execute("SELECT seq, session, elapsed_s, utc_s, hash FROM record ORDER BY seq DESC LIMIT 1")
    seq, session, elapsed_s, utc_s, head = row
    word = Rescued(to=str(copy.absolute()))
    record = Record(session, word.kind, elapsed_s, utc_s, status=word.status, body=encode(word.body()))
    values = (seq + 1, *record, head, link(head, seq + 1, record))
    db.execute(INSERT_RECORD, values)
    db.wal_checkpoint(mode=apsw.SQLITE_CHECKPOINT_TRUNCATE)
