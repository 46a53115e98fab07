"""What a file would be after a power cut: its changes since it was last synced, and which of them reached the disk."""

from __future__ import annotations

import random
from dataclasses import dataclass
from enum import Enum

SECTOR = 512
"""Bytes a disk writes whole or not at all, at multiples of this."""


class Fate(Enum):
    """Where a change is."""

    PENDING = "in memory only: a power cut may take it"
    DURABLE = "on the disk"
    LOST = "marked as written by a failed fsync although the disk never took it: a power cut takes it"


@dataclass
class Change:
    """One write, or one truncation.

    Attributes:
        offset: where the write begins; for a truncation the new size.
        data: what was written; None for a truncation.
        before: bytes that were there: under the write, or behind the new end.
        size_before: the file's size.
        fate: where it is.

    """

    offset: int
    data: bytes | None
    before: bytes
    size_before: int
    fate: Fate = Fate.PENDING


class CachedFile:
    """Changes of one file that a power cut may take back, in order."""

    def __init__(self) -> None:
        self.changes: list[Change] = []

    def synced(self) -> None:
        """All pending changes are on the disk now."""
        if not any(c.fate is Fate.LOST for c in self.changes):
            self.changes.clear()
        self._settle(Fate.DURABLE)

    def sync_failed(self) -> None:
        """As ext4 after a failed fsync: pending changes stay in memory, marked clean, and never reach the disk."""
        self._settle(Fate.LOST)

    def _settle(self, fate: Fate) -> None:
        for change in self.changes:
            if change.fate is Fate.PENDING:
                change.fate = fate

    def after_power_cut(self, content: bytes, lost: random.Random | bool) -> bytes:
        """The file after the power came back.

        Args:
            content: what it was a moment before, everything in memory included.
            lost: True: every pending change is lost; False: none is; a generator: a random subset, torn at sectors.

        """
        data = bytearray(content)
        for change in reversed(self.changes):
            if change.data is None:
                data[change.offset :] = change.before
            else:
                data[change.offset : change.offset + len(change.before)] = change.before
                del data[change.size_before :]
        keep = lost.choice((0.0, 0.5, 0.9, lost.random())) if isinstance(lost, random.Random) else float(not lost)
        for change in self.changes:
            if change.fate is Fate.DURABLE or (change.fate is Fate.PENDING and keep == 1.0):
                _apply(data, change.offset, change.data)
            elif change.fate is Fate.PENDING and isinstance(lost, random.Random):
                _apply_some(data, change, keep, lost)
        if isinstance(lost, random.Random) and lost.random() < 0.2:
            data.extend(bytes(max(0, len(content) - len(data))))  # the size reached the disk, the data did not
        return bytes(data)


def _apply(data: bytearray, offset: int, written: bytes | None) -> None:
    if written is None:
        del data[offset:]
        data.extend(bytes(offset - len(data)))
        return
    data.extend(bytes(max(0, offset - len(data))))
    data[offset : offset + len(written)] = written


def _apply_some(data: bytearray, change: Change, keep: float, rng: random.Random) -> None:
    """Part of one change: sectors of a write survive or not, each by itself; a truncation whole or not at all."""
    torn = change.data is not None and rng.random() < 0.5
    if not torn:
        if rng.random() < keep:
            _apply(data, change.offset, change.data)
        return
    assert change.data is not None
    start = change.offset
    while start < change.offset + len(change.data):
        stop = min((start // SECTOR + 1) * SECTOR, change.offset + len(change.data))
        if rng.random() < keep:
            _apply(data, start, change.data[start - change.offset : stop - change.offset])
        start = stop
