"""A look at a write-ahead log before SQLite opens it.

SQLite recovers by replaying the log up to the last commit whose checksums hold, and drops whatever follows
without a word. For a run file that silence is not acceptable, so the log is read here first, by the file format
(https://www.sqlite.org/fileformat2.html#the_write_ahead_log), and what will be dropped is counted.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path

_HEADER = struct.Struct(">8I")
_FRAME = struct.Struct(">6I")
_MAGIC_LITTLE, _MAGIC_BIG = 0x377F0682, 0x377F0683


@dataclass(frozen=True)
class WalState:
    """What a write-ahead log holds.

    Attributes:
        frames: frames belonging to the log's present generation.
        replayed: of those, how many SQLite will replay (up to the last good commit).
        lost_commits: commit marks among the frames that it will not replay: transactions that were once durable
            and are not any more. Frames without a commit mark were never durable.
        damage: what is wrong, "" if nothing.

    """

    frames: int
    replayed: int
    lost_commits: int
    damage: str

    @property
    def dropped(self) -> int:
        """Frames SQLite will drop silently."""
        return self.frames - self.replayed


_CLEAN = WalState(0, 0, 0, "")


def _checksum(data: bytes, order: str, s0: int, s1: int) -> tuple[int, int]:
    words = struct.unpack(f"{order}{len(data) // 4}I", data)
    for i in range(0, len(words), 2):
        s0 = (s0 + words[i] + s1) & 0xFFFFFFFF
        s1 = (s1 + words[i + 1] + s0) & 0xFFFFFFFF
    return s0, s1


def inspect(database: Path) -> WalState:
    """Read the log beside `database` (`...-wal`); a missing or empty one is clean.

    Raises:
        OSError: the log exists and cannot be read.

    """
    log = database.with_name(database.name + "-wal")
    try:
        data = log.read_bytes()
    except FileNotFoundError:
        return _CLEAN
    if not data:
        return _CLEAN
    if len(data) < _HEADER.size:
        return WalState(0, 0, 0, f"the log's header is cut short ({len(data)} of {_HEADER.size} bytes)")
    magic, _, page, _, salt0, salt1, sum0, sum1 = _HEADER.unpack_from(data)
    if magic not in (_MAGIC_LITTLE, _MAGIC_BIG):
        return _unusable(data, page, "the log's header is not one")
    order = ">" if magic == _MAGIC_BIG else "<"
    running = _checksum(data[:24], order, 0, 0)
    if running != (sum0, sum1):
        return _unusable(data, page, "the log's header fails its checksum")
    return _frames(data, page, order, (salt0, salt1), running)


def _frames(data: bytes, page: int, order: str, salts: tuple[int, int], running: tuple[int, int]) -> WalState:
    size = _FRAME.size + page
    frames = replayed = lost = 0
    damage = ""
    for at in range(_HEADER.size, len(data), size):
        if at + _FRAME.size > len(data):
            damage = damage or f"frame {frames + 1} is cut short"
            break
        _, commit, salt0, salt1, sum0, sum1 = _FRAME.unpack_from(data, at)
        if (salt0, salt1) != salts and not damage:
            if not _present_again(data, at + size, size, salts):
                break  # left over from an earlier generation of the log: not part of it
            damage = f"frame {frames + 1} does not belong to its log"
        body = data[at + _FRAME.size : at + size]
        frames += 1
        if len(body) < page:
            damage = damage or f"frame {frames} is cut short"
            break
        if not damage:
            running = _checksum(data[at : at + 8], order, *running)
            running = _checksum(body, order, *running)
            if running != (sum0, sum1):
                damage = f"frame {frames} fails its checksum"
        if commit:
            if damage:
                lost += 1
            else:
                replayed = frames
    return WalState(frames, replayed, lost, damage)


def _present_again(data: bytes, start: int, size: int, salts: tuple[int, int]) -> bool:
    """Whether a frame of the present generation follows."""
    return any(_FRAME.unpack_from(data, at)[2:4] == salts for at in range(start, len(data) - _FRAME.size + 1, size))


def _unusable(data: bytes, page: int, damage: str) -> WalState:
    """A log whose header cannot be trusted: none of its frames is replayed, every commit mark counts as lost."""
    if not (512 <= page <= 65536 and page & (page - 1) == 0):
        page = 4096
    places = range(_HEADER.size, len(data) - _FRAME.size + 1, _FRAME.size + page)
    commits = sum(bool(_FRAME.unpack_from(data, at)[1]) for at in places)
    return WalState(len(places), 0, commits, damage)
