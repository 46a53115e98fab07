"""Operations on folders and files that SQLite does not offer: durable folder entries, rewriting a log.

SQLite accesses the disk through a VFS. The other operations (a rename, the entry of a new file in its folder) are here.
They are registered under the name of the VFS, so that a simulated disk can cut the power of both (`proving.disk`).
"""

from __future__ import annotations

import os
from pathlib import Path

_CHUNK = 1 << 20
"""Bytes read and written at once; chosen."""


class Storage:
    """A real disk. Every method raises OSError if the operation fails."""

    def make_folder(self, folder: Path) -> None:
        """Create a folder and its parents; each is durable before anything is put into it."""
        new = []
        # Each entry is synced in its parent: a file in a folder whose entry was lost is lost with it.
        while not folder.exists():
            new.append(folder)
            folder = folder.parent
        for made in reversed(new):
            made.mkdir(exist_ok=True)
            self.sync_folder(made.parent)

    def replace(self, source: Path, target: Path) -> None:
        """Rename; durable once the folder is synced."""
        os.replace(source, target)

    def remove(self, path: Path) -> None:
        """Remove a file if it is there; durable once the folder is synced."""
        path.unlink(missing_ok=True)

    def sync_folder(self, folder: Path) -> None:
        """Make the entries of a folder durable."""
        descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)

    def rewrite(self, path: Path) -> None:
        """Write a file's bytes over themselves and sync it.

        After a failed fsync Linux keeps the data in memory and marks them as written, although the disk never took
        them. A later fsync succeeds, but a power cut still loses them. Rewriting them makes the next fsync write them.
        """
        with path.open("r+b", buffering=0) as file:
            at = 0
            while data := os.pread(file.fileno(), _CHUNK, at):
                if os.pwrite(file.fileno(), data, at) != len(data):  # a full disk takes a part without an error
                    raise OSError(28, "No space left on device", str(path))
                at += len(data)
            os.fsync(file.fileno())


_storages: dict[str, Storage] = {"": Storage()}


def storage_of(vfs: str) -> Storage:
    """The storage of a VFS; the real disk if no other is registered."""
    return _storages.get(vfs, _storages[""])


def register(vfs: str, storage: Storage) -> Storage | None:
    """Register `storage` for a VFS ("": the default one); returns its predecessor."""
    before = _storages.get(vfs)
    _storages[vfs] = storage
    return before


def unregister(vfs: str, before: Storage | None) -> None:
    """Restore the predecessor that `register` returned."""
    if before is None:
        _storages.pop(vfs, None)
    else:
        _storages[vfs] = before
