"""The VFS of a simulated disk: SQLite's reads, writes and syncs on their way to real files."""

# ruff: noqa: D102 - what a `Medium` does is described where it is done

from __future__ import annotations

import os
from typing import Any, Protocol

import apsw

from proving.disk.page_cache import CachedFile, Change


class Medium(Protocol):
    """What a VFS asks of the disk behind it; `proving.disk.simulated.Disk` says what each does."""

    name: str
    boot: int

    def alive(self) -> None: ...
    def file(self, name: str) -> CachedFile: ...
    def opened(self, name: str) -> None: ...
    def closed(self, name: str, boot: int) -> None: ...
    def created(self, name: str) -> None: ...
    def deleted(self, name: str) -> None: ...
    def folder_synced(self, folder: str) -> None: ...
    def room_for(self, growth: int) -> int: ...
    def write_fails(self) -> bool: ...
    def wrote(self) -> None: ...
    def syncing(self) -> bool: ...


_UNTRACKED = (
    apsw.SQLITE_OPEN_TEMP_DB
    | apsw.SQLITE_OPEN_TEMP_JOURNAL
    | apsw.SQLITE_OPEN_TRANSIENT_DB
    | apsw.SQLITE_OPEN_SUBJOURNAL
)
_SYNCS_FOLDER = apsw.SQLITE_OPEN_WAL | apsw.SQLITE_OPEN_MAIN_JOURNAL | apsw.SQLITE_OPEN_SUPER_JOURNAL


class DiskVfs(apsw.VFS):
    """Opens files of a disk; what has no name or no lasting meaning goes straight to the operating system."""

    def __init__(self, disk: Medium) -> None:
        super().__init__(disk.name, "unix")
        self._disk = disk

    def xOpen(self, name: str | apsw.URIFilename | None, flags: list[int]) -> apsw.VFSFile:  # noqa: N802
        """Called by SQLite."""
        plain = name.filename() if isinstance(name, apsw.URIFilename) else name
        if plain is None or flags[0] & _UNTRACKED:
            return apsw.VFSFile("unix", name, flags)
        self._disk.alive()
        return _File(self._disk, plain, name, flags)

    def xDelete(self, filename: str, syncdir: bool) -> None:  # noqa: N802
        """Called by SQLite."""
        self._disk.alive()
        if not os.path.exists(filename):
            return
        self._disk.deleted(filename)
        if syncdir:
            if self._disk.syncing():
                raise _io_error("fsync of the folder failed", apsw.SQLITE_IOERR_DIR_FSYNC)
            self._disk.folder_synced(os.path.dirname(filename))


class _File(apsw.VFSFile):
    def __init__(self, disk: Medium, plain: str, name: str | apsw.URIFilename | None, flags: list[int]) -> None:
        disk.opened(plain)
        new = not os.path.exists(plain)
        self._disk, self._name, self._boot = disk, plain, disk.boot
        self._syncs_folder = bool(flags[0] & _SYNCS_FOLDER and flags[0] & apsw.SQLITE_OPEN_CREATE)
        super().__init__("unix", name, flags)
        if new:
            disk.created(plain)

    def _alive(self, code: int) -> None:
        self._disk.alive()
        if self._boot != self._disk.boot:
            raise _io_error("the disk is gone", code)

    def xRead(self, amount: int, offset: int) -> bytes:  # noqa: N802
        self._alive(apsw.SQLITE_IOERR_READ)
        return super().xRead(amount, offset)

    def xWrite(self, data: Any, offset: int) -> None:  # noqa: N802
        self._alive(apsw.SQLITE_IOERR_WRITE)
        if self._disk.write_fails():
            raise _io_error("write failed", apsw.SQLITE_IOERR_WRITE)
        data, size = bytes(data), super().xFileSize()
        growth = max(0, offset + len(data) - size)
        short = growth - self._disk.room_for(growth)
        data = data[: len(data) - short]
        covered = min(len(data), max(0, size - offset))
        before = super().xRead(covered, offset) if covered else b""
        super().xWrite(data, offset)
        self._disk.file(self._name).changes.append(Change(offset, data, before, size))
        self._disk.wrote()
        if short:
            raise apsw.FullError("simulated: no space left on the disk")

    def xTruncate(self, newsize: int) -> None:  # noqa: N802
        self._alive(apsw.SQLITE_IOERR_TRUNCATE)
        if self._disk.write_fails():
            raise _io_error("truncation failed", apsw.SQLITE_IOERR_TRUNCATE)
        size = super().xFileSize()
        before = super().xRead(size - newsize, newsize) if size > newsize else b""
        super().xTruncate(newsize)
        self._disk.room_for(newsize - size)
        self._disk.file(self._name).changes.append(Change(newsize, None, before, size))
        self._disk.wrote()

    def xSync(self, flags: int) -> None:  # noqa: N802
        self._alive(apsw.SQLITE_IOERR_FSYNC)
        cached = self._disk.file(self._name)
        if self._disk.syncing():
            cached.sync_failed()
            raise _io_error("fsync failed", apsw.SQLITE_IOERR_FSYNC)
        cached.synced()
        if self._syncs_folder:
            self._syncs_folder = False
            self._disk.folder_synced(os.path.dirname(self._name))

    def xLock(self, level: int) -> None:  # noqa: N802
        self._alive(apsw.SQLITE_IOERR_LOCK)  # else closing it would fold the log into the file that is back now
        super().xLock(level)

    def xClose(self) -> None:  # noqa: N802
        super().xClose()
        self._disk.closed(self._name, self._boot)


def _io_error(what: str, code: int) -> apsw.IOError:
    error = apsw.IOError(f"simulated: {what}")
    error.extendedresult = code  # type: ignore[attr-defined]  # what SQLite is told
    return error
