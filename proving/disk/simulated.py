"""A disk that can lose power, fill up, fail and be slow, under the very SQLite that writes run files.

Files are real and always hold what a program would see; beside them it is remembered what has not been synced. Whoever
uses it opens run files with `vfs=disk.name`, and closes what was open before a power cut before opening it again.

    with Disk(seed=3) as disk:
        create(path, genesis, elapsed_s=0, utc_s=0, vfs=disk.name)
        run = RunWriter.open(path, vfs=disk.name)
        ...
        disk.power_cut()    # takes back a random part of what was not synced
        run.close()         # a file from before the cut can only be closed
        run = RunWriter.open(path, vfs=disk.name)

A folder's entries (new files, renames, removals) survive a power cut in the order they were made, up to a random one,
as a journalling file system keeps them; a folder made by `make_folder` survives always.
"""

from __future__ import annotations

import contextlib
import errno
import itertools
import os
import random
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Literal, Self

import apsw

from proving.disk.page_cache import CachedFile, Change
from proving.disk.vfs import DiskVfs
from rig.drivers.clock import Clock
from rig.run_file import storage

_names = itertools.count(1)


class Crash(BaseException):
    """The program stops here, as by SIGKILL or a power cut; the disk refuses it everything from now on."""


@dataclass
class _Entry:
    """A change of a folder that has not been synced: how to take it back."""

    folder: str
    undo: Callable[[], None]


class _Countdown:
    """The nth event from now, and so many after it."""

    def __init__(self) -> None:
        self._left = 0
        self._times = 0

    def set(self, nth: int, times: int = 1) -> None:
        self._left, self._times = nth, times

    def hit(self) -> bool:
        if self._left > 1:
            self._left -= 1
            return False
        if self._left == 1 and self._times > 0:
            self._times -= 1
            return True
        return False


@contextlib.contextmanager
def folding(pages: int) -> Iterator[None]:
    """Logs of run files that are opened meanwhile are folded into them after so many pages, not SQLite's own 1000."""

    def hook(database: apsw.Connection) -> None:
        database.wal_autocheckpoint(pages)

    apsw.connection_hooks.append(hook)
    try:
        yield
    finally:
        apsw.connection_hooks.remove(hook)


class Disk(storage.Storage):
    """A simulated disk under SQLite, over real files.

    Args:
        seed: of what a power cut takes.
        default: SQLite uses it wherever no VFS is named, as long as the context lasts.

    Attributes:
        name: of its VFS.
        writes: how many writes, truncations, renames and removals there were.
        syncs: how many syncs of files and folders.
        crashed: whether it refuses everything until `power_cut`.

    """

    def __init__(self, seed: int = 0, *, default: bool = False) -> None:
        self.name = f"disk-{next(_names)}"
        self.writes = 0
        self.syncs = 0
        self.crashed = False
        self.boot = 0
        self._rng = random.Random(seed)
        self._default = default
        self._files: dict[str, CachedFile] = {}
        self._entries: list[_Entry] = []
        self._open: Counter[tuple[str, int]] = Counter()
        self._crash, self._bad_sync, self._bad_write = (_Countdown() for _ in range(3))
        self._room: int | None = None
        self._slow: tuple[Clock, float, float] | None = None

    def __enter__(self) -> Self:
        default = apsw.vfs_names()[0]
        self._vfs = DiskVfs(self)
        self._before = [(self.name, storage.register(self.name, self), "")]
        if self._default:
            apsw.set_default_vfs(self.name)
            self._before.append(("", storage.register("", self), default))
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        for name, before, default in reversed(self._before):
            storage.unregister(name, before)
            if default:
                apsw.set_default_vfs(default)
        self._vfs.unregister()

    # What can go wrong

    def power_cut(self, lost: random.Random | Literal["all", "none", "some"] = "some") -> None:
        """Take back what was not synced, and let new files be opened again.

        Args:
            lost: "all" of it; "none" (the program died, the machine did not); "some": a random subset, torn at
                sectors, drawn from the disk's seed or from a generator of your own.

        """
        if isinstance(lost, str):
            chance: random.Random | bool = self._rng if lost == "some" else lost == "all"
        else:
            chance = lost
        self.boot += 1
        self.crashed = False
        for countdown in (self._crash, self._bad_sync, self._bad_write):
            countdown.set(0)
        if chance is False:
            return  # whatever is in memory stays there, also what a failed fsync left behind
        survive = chance.randint(0, len(self._entries)) if isinstance(chance, random.Random) else 0
        for entry in reversed(self._entries[survive:]):
            entry.undo()
        self._entries.clear()
        for name, cached in self._files.items():
            if cached.changes and os.path.exists(name):
                _overwrite(name, cached.after_power_cut(Path(name).read_bytes(), chance))
        self._files.clear()

    def crash_at(self, nth: int) -> None:
        """Raise `Crash` at the nth write or sync from now: after the write is in memory, before the sync is done."""
        self._crash.set(nth)

    def fail_sync(self, nth: int = 1, times: int = 1) -> None:
        """Let the nth sync from now fail, and the next ones up to `times`, as ext4 fails (`CachedFile.sync_failed`)."""
        self._bad_sync.set(nth, times)

    def fail_write(self, nth: int = 1) -> None:
        """Let the nth write from now fail with an I/O error."""
        self._bad_write.set(nth)

    def full_after(self, room: int | None) -> None:
        """Let files grow by `room` bytes more in all, then be full; None: there is room again."""
        self._room = room

    def slow(self, clock: Clock | None, write_s: float = 0.0, sync_s: float = 0.0) -> None:
        """Let every write and sync take time on a clock; None: quick again."""
        self._slow = None if clock is None else (clock, write_s, sync_s)

    # Folder entries, in place of the real disk's

    def replace(self, source: Path, target: Path) -> None:
        """As `Storage`; pending until the folder is synced."""
        self.alive()
        old, new = _key(source), _key(target)
        covered = Path(new).read_bytes() if os.path.exists(new) else None
        moved, under = self._files.pop(old, CachedFile()), self._files.pop(new, None)
        os.replace(old, new)
        self._files[new] = moved

        def undo() -> None:
            os.replace(new, old)
            self._files[old] = self._files.pop(new, CachedFile())
            if covered is not None:
                Path(new).write_bytes(covered)
                self._files[new] = under or CachedFile()

        self._entries.append(_Entry(os.path.dirname(new), undo))
        self.wrote()

    def remove(self, path: Path) -> None:
        """As `Storage`; pending until the folder is synced."""
        self.alive()
        if os.path.exists(path):
            self.deleted(_key(path))

    def sync_folder(self, folder: Path) -> None:
        """As `Storage`."""
        self.alive()
        if self.syncing():
            raise OSError(errno.EIO, "Input/output error (simulated: fsync of the folder failed)", str(folder))
        self.folder_synced(os.path.realpath(folder))

    def rewrite(self, path: Path) -> None:
        """As `Storage`."""
        self.alive()
        content = path.read_bytes()
        cached = self.file(_key(path))
        cached.changes.append(Change(0, content, content, len(content)))
        self.wrote()
        if self.syncing():
            cached.sync_failed()
            raise OSError(errno.EIO, "Input/output error (simulated: fsync failed)", str(path))
        cached.synced()

    # What the VFS and its files need

    def alive(self) -> None:
        """Raise `Crash` again after a crash: whatever still runs is not there any more."""
        if self.crashed:
            raise Crash("the program is gone")

    def file(self, name: str) -> CachedFile:
        """The unsynced changes of a file."""
        return self._files.setdefault(name, CachedFile())

    def opened(self, name: str) -> None:
        """Refuse a file that is still open from before a power cut: its connection shares locks with the new one."""
        if any(count and other == name and boot != self.boot for (other, boot), count in self._open.items()):
            raise RuntimeError(f"{name} is still open from before the power cut: close it first")
        self._open[name, self.boot] += 1

    def closed(self, name: str, boot: int) -> None:
        """A file that was opened in that life of the machine was closed."""
        self._open[name, boot] -= 1
        if not self._open[name, boot]:
            del self._open[name, boot]  # a campaign opens the same file tens of thousands of times

    def created(self, name: str) -> None:
        """A file has come into being; its entry is pending."""

        def undo() -> None:
            Path(name).unlink(missing_ok=True)
            self._files.pop(name, None)

        self._entries.append(_Entry(os.path.dirname(name), undo))

    def deleted(self, name: str) -> None:
        """Delete a file; pending until its folder is synced."""
        content, cached = Path(name).read_bytes(), self._files.pop(name, CachedFile())
        os.unlink(name)
        if self._room is not None:
            self._room += len(content)

        def undo() -> None:
            if Path(name).parent.exists():  # a folder that was taken away whole, as of a rehearsal, stays away
                Path(name).write_bytes(content)
                self._files[name] = cached

        self._entries.append(_Entry(os.path.dirname(name), undo))
        self.wrote()

    def folder_synced(self, folder: str) -> None:
        """The entries of a folder are durable."""
        self._entries = [entry for entry in self._entries if entry.folder != folder]

    def room_for(self, growth: int) -> int:
        """How much of `growth` bytes there is room for; takes it."""
        if self._room is None:
            return growth
        taken = min(growth, self._room)
        self._room -= taken
        return taken

    def write_fails(self) -> bool:
        """Whether this write is to fail."""
        return self._bad_write.hit()

    def wrote(self) -> None:
        """A write is in memory: it takes its time, or is the last."""
        self.writes += 1
        if self._slow is not None:
            self._slow[0].sleep(self._slow[1])
        self._last()

    def syncing(self) -> bool:
        """A sync begins: it takes its time, or is the last. Whether it is to fail."""
        self.syncs += 1
        if self._slow is not None:
            self._slow[0].sleep(self._slow[2])
        self._last()
        return self._bad_sync.hit()

    def _last(self) -> None:
        if self._crash.hit():
            self.crashed = True
            raise Crash(f"write {self.writes}, sync {self.syncs}")


def _key(path: Path) -> str:
    return os.path.join(os.path.realpath(path.parent), path.name)


def _overwrite(name: str, content: bytes) -> None:
    with open(name, "r+b") as file:
        file.write(content)
        file.truncate()
