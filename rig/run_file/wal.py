"""Inspection of a write-ahead log before SQLite opens it.

SQLite recovers by replaying the log up to the last commit with correct checksums, and silently drops the rest.
This is not acceptable for a run file. So the log is read here first, by the file format
(https://www.sqlite.org/fileformat2.html#the_write_ahead_log), and the dropped frames are counted.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from rig.files.regular import open_regular

_HEADER = struct.Struct(">8I")
_FRAME = struct.Struct(">6I")
_MAGIC_LITTLE, _MAGIC_BIG = 0x377F0682, 0x377F0683
_GENERATIONS = 1 << 24
"""Maximum number of generations of a log: it restarts every few hundred points."""


@dataclass(frozen=True)
class WalState:
    """Contents of a write-ahead log.

    Attributes:
        frames: frames belonging to the log's present generation.
        replayed: number of these that SQLite will replay (up to the last good commit).
        lost_commits: commit marks among the frames that it will not replay: transactions that were once durable
            and are not any more. Frames without a commit mark were never durable.
        damage: description of the damage, "" if none.

    """

    frames: int
    replayed: int
    lost_commits: int
    damage: str

    @property
    def dropped(self) -> int:
        """Number of frames that SQLite will drop silently."""
        return self.frames - self.replayed


_CLEAN = WalState(0, 0, 0, "")

Order = Literal["<", ">"]
"""Byte order of the log's numbers."""


def _checksum(data: bytes, order: Order, s0: int, s1: int) -> tuple[int, int]:
    """Add to the format's running checksum: for each pair of words, s0 += x + s1, then s1 += y + s0, modulo 2^32.

    This is linear: n pairs multiply (s0, s1) by the nth power of [[1, 1], [1, 2]]. Each pair adds (x, x + y),
    multiplied by the power of its number of later pairs.
    """
    words = np.frombuffer(data, np.dtype(np.uint32).newbyteorder(order)).astype(np.uint32)
    x = words[::2]
    both = x + words[1::2]
    (a, b, c), (an, bn, cn) = _powers(len(x))
    s0, s1 = (
        (an * s0 + bn * s1 + int(np.sum(a * x + b * both, dtype=np.uint32))),
        (bn * s0 + cn * s1 + int(np.sum(b * x + c * both, dtype=np.uint32))),
    )
    return s0 & 0xFFFFFFFF, s1 & 0xFFFFFFFF


@cache
def _powers(pairs: int) -> tuple[NDArray[np.uint32], tuple[int, int, int]]:
    """The powers pairs - 1 to 0 of [[1, 1], [1, 2]] as rows a, b, c of [[a, b], [b, c]], and the power `pairs`."""
    rows = []
    a, b, c = 1, 0, 1
    for _ in range(pairs):
        rows.append((a, b, c))
        a, b, c = (a + b) & 0xFFFFFFFF, (a + 2 * b) & 0xFFFFFFFF, (b + 2 * c) & 0xFFFFFFFF
    return np.array(rows[::-1], np.uint32).reshape(-1, 3).T.copy(), (a, b, c)


def inspect(database: Path) -> WalState:
    """Read the log beside `database` (`...-wal`); a missing or empty one is clean.

    Raises:
        OSError: the log exists and cannot be read.

    """
    log = Path(f"{database}-wal")
    try:
        with open_regular(log) as file:
            data = file.read()
    except FileNotFoundError:
        return _CLEAN
    if not data:
        return _CLEAN
    if len(data) < _HEADER.size:
        return WalState(0, 0, 0, f"the log's header is cut short ({len(data)} of {_HEADER.size} bytes)")
    magic, _, page, _, salt0, salt1, sum0, sum1 = _HEADER.unpack_from(data)
    if magic not in (_MAGIC_LITTLE, _MAGIC_BIG):
        return _unusable(data, page, "the log's header is not one")
    order: Order = ">" if magic == _MAGIC_BIG else "<"
    running = _checksum(data[:24], order, 0, 0)
    if running != (sum0, sum1):
        return _unusable(data, page, "the log's header fails its checksum")
    return _frames(data, page, order, (salt0, salt1), running)


def _frames(data: bytes, page: int, order: Order, salts: tuple[int, int], running: tuple[int, int]) -> WalState:
    size = _FRAME.size + page
    places = range(_HEADER.size, len(data), size)
    frames = replayed = lost = 0
    damage = ""
    for at in places[: _present(data, places, salts)]:
        frames += 1
        if at + size > len(data):
            damage = damage or f"frame {frames} is cut short"
            break
        _, commit, salt0, salt1, sum0, sum1 = _FRAME.unpack_from(data, at)
        if not damage:  # checksums run on from frame to frame: after a bad one no later one can be checked
            running = _checksum(data[at : at + 8], order, *running)
            running = _checksum(data[at + _FRAME.size : at + size], order, *running)
            if (salt0, salt1) != salts:
                damage = f"frame {frames} does not belong to its log"
            elif running != (sum0, sum1):
                damage = f"frame {frames} fails its checksum"
        if commit:  # size of the database after the transaction; 0 in the frames before its last one
            if damage:
                lost += 1
            else:
                replayed = frames
    return WalState(frames, replayed, lost, damage)


def _present(data: bytes, places: range, salts: tuple[int, int]) -> int:
    """Number of frames of the log's present generation: up to the last valid one, and damaged ones after it.

    The rest is left over from earlier generations. Their first salt is smaller than the present one and their
    second is random. A frame that shares one salt with the present generation belongs to it and is damaged.
    """
    whole = [_FRAME.unpack_from(data, at)[2:4] for at in places if at + _FRAME.size <= len(data)]
    count = max((i for i, own in enumerate(whole, 1) if own == salts), default=0)
    for own in whole[count:]:
        if 0 < (salts[0] - own[0]) & 0xFFFFFFFF < _GENERATIONS and own[1] != salts[1]:
            return count
        count += 1
    return len(places)


def _unusable(data: bytes, page: int, damage: str) -> WalState:
    """A log with an invalid header: none of its frames is replayed, every commit mark counts as lost."""
    if not (512 <= page <= 65536 and page & (page - 1) == 0):
        page = 4096
    places = range(_HEADER.size, len(data) - _FRAME.size + 1, _FRAME.size + page)
    commits = sum(bool(_FRAME.unpack_from(data, at)[1]) for at in places)
    return WalState(len(places), 0, commits, damage)
