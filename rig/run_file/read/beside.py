"""The files beside a run file, log and journal: check that they belong to it.

SQLite uses any file with the right name. An earlier log of the same run, or a log of another run, hides the records of
the file or mixes with them. (Copying a finished run over an interrupted one leaves such a log.) A foreign journal is
rolled back into the file. But a run file only grows: each of its own records is still there when its own log is added.
And its own journal changes only the mode in its header.
"""

from __future__ import annotations

import contextlib
import os
import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from operator import length_hint
from pathlib import Path
from typing import Any

import apsw

from rig.errors import RunFileError
from rig.files.regular import check_regular, open_regular
from rig.procedures.present.shell import shell_word
from rig.run_file.chain import followed
from rig.run_file.saved import saved_words
from rig.run_file.schema import Guarded

_WAL_HEADER, _FRAME_HEADER = 32, 24
_JOURNAL_MAGIC = bytes.fromhex("d9d505f920a163d7")
_MODE = (*range(18, 20), *range(24, 28), *range(92, 100))
"""Bytes of page 1 that a change of mode changes: read and write version, change counter, and SQLite version of the
change."""
_TABLE_LEAF = 13
_MOST_KEYS, _MOST_BYTES = 20_000, 256 << 20
"""Records looked at, and bytes of them: limits for a file that was made to take for ever. Chosen."""

_LAST = "SELECT max(seq) FROM record"
_ASKED = 500
"""Records that one statement is asked for: SQLite limits the placeholders of a statement."""


class ForeignFileError(RunFileError):
    """A log or journal beside a run file is not its own; nothing was changed."""


@dataclass(frozen=True)
class Alone:
    """Contents of a run file without its log.

    Attributes:
        records: number of records.
        known: number and hash of its last record and of others that the log could hide; each hash was checked.

    """

    records: int
    known: tuple[tuple[int, bytes], ...]


def has_log(path: Path) -> bool:
    """Whether there is a log that is not empty."""
    with contextlib.suppress(OSError):
        return os.stat(f"{path}-wal").st_size > _WAL_HEADER
    return False


def alone(path: Path, main: Guarded) -> Alone:
    """Read a run file without its log, before the log is read: a running writer only adds to the file.

    Args:
        path: the run file.
        main: a connection that reads it without its log.

    Raises:
        apsw.Error: it cannot be read without the log, for example after a crash during a checkpoint.

    """
    last = next(iter(main.rows(_LAST)))[0] or 0
    keys = {1, last or 1, *(key for key in _hidden(path) if 1 <= key <= last)}
    known, content = [], 0
    for row in _records(main, "*", sorted(keys, reverse=True)):
        content += sum(map(length_hint, row))
        if content > _MOST_BYTES:
            raise apsw.TooBigError("a few of its records give more content than they can have")
        if followed([row], row[0], row[10]):  # half a checkpoint gives half a record
            known.append((row[0], row[11]))
    return Alone(last, tuple(known))


def _records(db: Guarded, columns: str, keys: Sequence[int]) -> Iterator[tuple[Any, ...]]:
    """Columns of those records that are there, the last first."""
    for at in range(0, len(keys), _ASKED):
        some = tuple(keys[at : at + _ASKED])
        marks = ", ".join("?" * len(some))
        yield from db.rows(f"SELECT {columns} FROM record WHERE seq IN ({marks}) ORDER BY seq DESC", some)


def check_log(path: Path, by_itself: Alone, view: Guarded) -> None:
    """Refuse a log that hides records of the file, or with which a record is not followed by its successor.

    Args:
        path: the run file.
        by_itself: contents without the log.
        view: a connection that reads it with the log.

    Raises:
        ForeignFileError: the log belongs to another file.

    """
    try:
        last = next(iter(view.rows(_LAST)))[0] or 0
        held = dict(_records(view, "seq, hash", [seq for seq, _ in by_itself.known]))
        after = dict(_records(view, "seq, previous", [seq + 1 for seq, _ in by_itself.known if seq < last]))
        missing = [seq for seq, own in by_itself.known if held.get(seq) != own]
        missing += [seq + 1 for seq, own in by_itself.known if seq < last and after.get(seq + 1) != own]
    except apsw.Error as error:
        raise foreign_log(path, by_itself.records, f"cannot be read ({error})") from error
    if not missing:
        return
    if last < min(missing):
        raise foreign_log(path, by_itself.records, f"has {last}")
    raise foreign_log(path, by_itself.records, f"has no record {min(missing)}, or another")


def foreign_log(path: Path, records: int, seen: str) -> ForeignFileError:
    """The error for a log that belongs to another file.

    Args:
        path: the run file.
        records: number of records without the log.
        seen: the result with the log; the end of a sentence.

    """
    return ForeignFileError(
        f"{path}-wal is not the log of {path}, or an old or damaged one: by itself the file has {records} record(s), "
        f"with that log it {seen}. Nothing was changed. {_move(path, 'wal')}"
    )


def check_journal(path: Path) -> None:
    """Refuse anything beside a run that is not a regular file, and a journal that would change more than the mode.

    Raises:
        ForeignFileError: it belongs to another file.

    """
    for suffix in ("wal", "shm", "journal"):
        _must_be_a_file(path, suffix)
    try:
        with open_regular(path.with_name(path.name + "-journal")) as file:
            header = file.read(28)
            if len(header) < 28 or header[:8] != _JOURNAL_MAGIC:
                return  # SQLite uses nothing of it
            count, nonce, pages, sector, size = struct.unpack_from(">5I", header, 8)
            file.seek(sector)
            data = file.read(size * 1000)  # its own journal has one page: a change of mode
        with path.open("rb") as main:
            wrong = _put_back(main.fileno(), data, count, nonce, pages, size)
    except OSError:
        return
    if wrong:
        raise ForeignFileError(
            f"{path}-journal is not the journal of {path}: rolled back, {wrong}. Nothing was changed. "
            f"{_move(path, 'journal')}"
        )


def _must_be_a_file(path: Path, suffix: str) -> None:
    """Refuse a pipe, for which SQLite would wait for ever, and a link, which it does not open. Raises
    `ForeignFileError`.
    """
    beside = path.with_name(f"{path.name}-{suffix}")
    try:
        check_regular(os.lstat(beside).st_mode, beside)
    except FileNotFoundError:
        return
    except OSError as error:
        raise ForeignFileError(
            f"{beside} is not a file of {path}: {error.strerror}. Nothing was changed. {_move(path, suffix)}"
        ) from error


def _move(path: Path, suffix: str) -> str:
    return (
        f"{saved_words(path)}Move {path}-{suffix} to another folder and keep it (it may belong to another copy of the "
        f"run); then `rig verify {shell_word(path)}` says what the file holds"
    )


def _hidden(path: Path) -> Iterator[int]:
    """Numbers of the last rows of all leaf pages that the log has other versions of.

    Frames of an earlier generation of the log, which have another salt, are not read by SQLite and hide nothing.
    """
    with contextlib.suppress(OSError), path.open("rb") as main, open(f"{path}-wal", "rb") as log:
        header = log.read(_WAL_HEADER)
        size = struct.unpack_from(">I", header, 8)[0] if len(header) == _WAL_HEADER else 0
        if not (512 <= size <= 65536 and size & (size - 1) == 0):
            return
        seen: set[int] = set()
        for at in range(_WAL_HEADER, os.fstat(log.fileno()).st_size - _FRAME_HEADER + 1, _FRAME_HEADER + size):
            frame = os.pread(log.fileno(), _FRAME_HEADER, at)
            if len(frame) < _FRAME_HEADER or frame[8:16] != header[16:24]:
                continue
            (number,) = struct.unpack_from(">I", frame)
            if number > 1 and number not in seen and len(seen) < _MOST_KEYS:
                seen.add(number)
                key = _last_key(os.pread(main.fileno(), size, (number - 1) * size))
                if key is not None:
                    yield key


def _last_key(page: bytes) -> int | None:
    """Number of the last row of a table's leaf page; None for any other page."""
    if len(page) < 512 or page[0] != _TABLE_LEAF:
        return None
    (cells,) = struct.unpack_from(">H", page, 3)
    if not 0 < cells <= (len(page) - 8) // 2:
        return None
    (at,) = struct.unpack_from(">H", page, 8 + 2 * (cells - 1))
    while at < len(page) and page[at] >= 0x80:  # size of the row
        at += 1
    key = 0
    for byte in page[at + 1 : at + 9]:
        key = key << 7 | byte & 0x7F
        if byte < 0x80:
            return key
    return None


def _put_back(main: int, data: bytes, count: int, nonce: int, pages: int, size: int) -> str:
    """Changes by a journal besides the mode, "" if none."""
    there = os.fstat(main).st_size
    if pages * size != there:
        return f"the file would have {pages * size} bytes instead of {there}"
    whole = range(0, len(data) - size - 7, size + 8)
    for at in whole[: count if 0 < count < 0xFFFFFFFF else None]:
        (number,) = struct.unpack_from(">I", data, at)
        before = data[at + 4 : at + 4 + size]
        (check,) = struct.unpack_from(">I", data, at + 4 + size)
        if check != (nonce + sum(before[i] for i in range(size - 200, 0, -200))) & 0xFFFFFFFF:
            break  # SQLite stops here
        now = bytearray(os.pread(main, size, (number - 1) * size))
        if number == 1:
            for i in _MODE:
                now[i : i + 1] = before[i : i + 1]
        if before != now:
            return f"page {number} of the file would be another one"
    return ""
