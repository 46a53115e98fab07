"""A disk that is not waited for, for run files that nobody keeps, such as those of rehearsals.

SQLite writes as always, and leaves it to the operating system when. Such a file is not safe from a power cut.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import apsw

from rig.run_file.storage import Storage, register, unregister

_numbers = itertools.count(1)


class _File(apsw.VFSFile):
    def __init__(self, name: str | apsw.URIFilename | None, flags: list[int]) -> None:
        super().__init__("", name, flags)

    def xSync(self, flags: int) -> None:  # noqa: N802 - apsw's name
        """Leave it to the system."""


class _Vfs(apsw.VFS):
    def __init__(self, name: str) -> None:
        super().__init__(name, "")

    def xOpen(self, name: str | apsw.URIFilename | None, flags: list[int]) -> apsw.VFSFile:  # noqa: N802 - apsw's name
        return _File(name, flags)


class _Unsynced(Storage):
    def sync_folder(self, folder: Path) -> None:
        """Leave it to the system."""


@contextmanager
def unsynced() -> Iterator[str]:
    """The name of a VFS that waits for no disk, as long as the context lasts."""
    name = f"unsynced-{next(_numbers)}"
    vfs, before = _Vfs(name), register(name, _Unsynced())
    try:
        yield name
    finally:
        unregister(name, before)
        vfs.unregister()
