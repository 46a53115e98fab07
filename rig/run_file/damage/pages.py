"""Rows of a run file, read from its pages without SQLite, because SQLite stops at the first defect.

This follows the file format (https://www.sqlite.org/fileformat2.html#b_tree_pages): the cells of table leaf pages, with
their overflow pages. Rows are not trusted; the caller must prove them. No cell is read twice from a page, and no
overflow page twice for a cell. The total amount read is limited by the size of the files.
"""

from __future__ import annotations

import mmap
import os
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from rig.errors import RunFileError

Value = int | float | str | bytes | None
Row = tuple[int, tuple[Value, ...]]
"""Row number and columns, as stored."""
Place = int
"""Place of a cell: 4096 times the start of its page, in file and log taken together, plus its start in the page."""

_PAGE = 4096
"""Page size of run files, bytes; a header with another value is damaged, or of another program."""
_WAL_HEADER, _FRAME_HEADER = 32, 24
_MOST_COLUMNS = 300
_MOST_BYTES = 64 << 20
"""Columns and bytes of a row: more than the schema allows, less than a made-up row could ask for. Chosen."""
_TIMES = 16
"""Limit on bytes read from overflow pages, in sizes of the files: the log has several versions of a page."""
_NO_BYTES, _REAL = (0, 8, 9), 7
_INTEGERS = {1: 1, 2: 2, 3: 3, 4: 4, 5: 6, 6: 8}


@dataclass
class _Most:
    """Budget of bytes that may still be read."""

    left: int

    def take(self, n: int) -> bool:
        """Whether this many bytes may still be read."""
        self.left -= n
        return self.left >= 0


@dataclass(frozen=True)
class _Cell:
    """A cell in its page: the part that does not fit begins in page `following`."""

    key: int
    types: list[int]
    begin: int
    size: int
    here: bytes
    following: int


class Pages:
    """The pages of a file and its log, in all stored versions.

    Args:
        path: the file.

    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._main, self._log = _mapped(path), _mapped(path.with_name(path.name + "-wal"))
        self._count = len(self._main) // _PAGE
        self._size = len(self._main) + len(self._log)
        self._overflow = _Most(0)
        self._logged: dict[int, list[int]] = {}
        for at in self._frames():
            (number,) = struct.unpack_from(">I", self._log, at - len(self._main) - _FRAME_HEADER)
            self._logged.setdefault(number, []).append(at)

    def cells(self) -> Iterator[tuple[Place, Iterator[Row]]]:
        """Every cell that may be a row, those of the file first, each with its budget.

        Raises:
            RunFileError: the pages lead to more content than the files can hold.

        """
        self._overflow = _Most((1 << 20) + _TIMES * self._size)
        for at in (*range(0, self._count * _PAGE, _PAGE), *self._frames()):
            page = self._page(at)
            for pointer, cell in _leaf(at == 0, page):
                yield at * _PAGE + pointer, self._rows(at, cell)

    def rows(self, place: Place) -> Iterator[Row]:
        """Rows of the cell at a place: more than one if there are several versions of its overflow pages."""
        at, pointer = divmod(place, _PAGE)
        cell = _cell(self._page(at), pointer, _Most(_PAGE))
        if cell is not None:
            yield from self._rows(at, cell)

    def _frames(self) -> Iterator[int]:
        """Starts of the pages of the log, including pages that SQLite would not replay."""
        for at in range(_WAL_HEADER, len(self._log) - _FRAME_HEADER - _PAGE + 1, _FRAME_HEADER + _PAGE):
            yield len(self._main) + at + _FRAME_HEADER

    def _page(self, at: int) -> bytes:
        if at < len(self._main):
            return bytes(self._main[at : at + _PAGE])
        return bytes(self._log[at - len(self._main) : at - len(self._main) + _PAGE])

    def _versions(self, number: int) -> list[int]:
        """Starts of all versions of a page, the newest first, that of the file last."""
        main = [(number - 1) * _PAGE] if 1 <= number <= self._count else []
        return [*reversed(self._logged.get(number, ())), *main]

    def _rows(self, at: int, cell: _Cell) -> Iterator[Row]:
        for payload in self._payloads(at, cell):
            try:
                yield cell.key, _columns(payload, cell.types, cell.begin)
            except (IndexError, struct.error, ValueError):
                continue

    def _payloads(self, at: int, cell: _Cell) -> Iterator[bytes]:
        if len(cell.here) == cell.size:
            yield cell.here
            return
        if cell.size > self._size:
            return
        main = len(self._main)
        choices: tuple[Callable[[list[int]], int], ...] = (
            lambda v: v[0],  # as SQLite reads it
            # the version at the time when the cell's page was written
            lambda v: next((p for p in v if p <= at), v[-1]),
            lambda v: v[-1] if v[-1] < main else v[0],  # the version for a foreign log
            lambda v: v[-1],
        )
        tried: list[list[int]] = []
        for choose in choices:
            places = self._followed(cell, choose)
            if places is None or places in tried:
                continue
            tried.append(places)
            if not self._overflow.take(cell.size):
                raise RunFileError(
                    f"{self._path}: its pages lead to more content than a file of its size can hold: "
                    f"this is no damage, it was made so. Nothing was restored; go on with a copy from before"
                )
            yield b"".join((cell.here, *(self._page(p)[4:] for p in places)))[: cell.size]

    def _followed(self, cell: _Cell, choose: Callable[[list[int]], int]) -> list[int] | None:
        """Starts of the overflow pages of a cell; None if a page is missing or they form a loop."""
        left, number = cell.size - len(cell.here), cell.following
        places: dict[int, int] = {}
        while left > 0:
            versions = self._versions(number)
            if not versions or number in places:
                return None
            places[number] = at = choose(versions)
            (number,) = struct.unpack(">I", self._page(at)[:4])
            left -= _PAGE - 4
        return list(places.values())


def _mapped(path: Path) -> mmap.mmap | bytes:
    if not path.is_file():
        return b""
    with path.open("rb") as file:
        size = os.fstat(file.fileno()).st_size
        return mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) if size else b""


def _leaf(first_of_file: bool, page: bytes) -> Iterator[tuple[int, _Cell]]:
    """The cells of a page read as a table's leaf page, even if its header differs: the header may be damaged."""
    first, pointers = len(page), set()
    at = (100 if first_of_file else 0) + 8
    types, content = _Most(_PAGE), _Most(2 * _PAGE)  # overlapping cells hold more than a page
    while at + 2 <= first:  # pointers end where the first cell begins, or before
        (pointer,) = struct.unpack_from(">H", page, at)
        at += 2
        if not at <= pointer < _PAGE or pointer in pointers:
            continue
        pointers.add(pointer)
        cell = _cell(page, pointer, types)
        if types.left < 0:
            return
        if cell is not None and content.take(len(cell.here)):
            first = min(first, pointer)
            yield pointer, cell


def _cell(page: bytes, at: int, most: _Most) -> _Cell | None:
    try:
        size, at = _varint(page, at)
        key, at = _varint(page, at)
        here = _here(size)
        if at + here + (4 if here < size else 0) > _PAGE:
            return None
        local = page[at : at + here]
        types, begin = _types(local, most)
        if begin + sum(map(_size, types)) != size:  # checked before overflow pages are followed
            return None
        following = struct.unpack_from(">I", page, at + here)[0] if here < size else 0
        return _Cell(key - (key >> 63 << 64), types, begin, size, local, following)
    except (IndexError, struct.error, ValueError):
        return None


def _here(size: int) -> int:
    """Number of bytes of a row that are in its leaf page, given its size in bytes."""
    if not 2 <= size <= _MOST_BYTES:
        raise ValueError("no record")
    most, least = _PAGE - 35, (_PAGE - 12) * 32 // 255 - 23
    if size <= most:
        return size
    here = least + (size - least) % (_PAGE - 4)
    return here if here <= most else least


def _columns(payload: bytes, types: list[int], at: int) -> tuple[Value, ...]:
    """A record's columns; the first begins at `at`. Raises ValueError or IndexError for an invalid record."""
    found: list[Value] = []
    for kind in types:
        value, at = _value(payload, at, kind)
        found.append(value)
    if at != len(payload):
        raise ValueError("no record")
    return tuple(found)


def _types(payload: bytes, most: _Most) -> tuple[list[int], int]:
    """Type of each column, and start of the first. Raises as `_columns`."""
    end, at = _varint(payload, 0)
    if not 1 < end <= min(len(payload), 9 * _MOST_COLUMNS):
        raise ValueError("no record")
    types: list[int] = []
    while at < end:
        kind, at = _varint(payload, at)
        types.append(kind)
        if not most.take(1) or len(types) > _MOST_COLUMNS:
            raise ValueError("no record")
    return types, end


def _size(kind: int) -> int:
    """Bytes of a column of this type."""
    return 0 if kind in _NO_BYTES else _INTEGERS.get(kind, 8 if kind == _REAL else (kind - 12) // 2)


def _value(payload: bytes, at: int, kind: int) -> tuple[Value, int]:
    if kind in _NO_BYTES:
        return (None if kind == 0 else kind - 8), at
    if kind in (10, 11):
        raise ValueError("reserved")
    size = _size(kind)
    data = payload[at : at + size]
    if len(data) < size:
        raise IndexError("cut short")
    if kind in _INTEGERS:
        return int.from_bytes(data, "big", signed=True), at + size
    if kind == _REAL:
        return struct.unpack(">d", data)[0], at + size
    return (data.decode() if kind % 2 else data), at + size


def _varint(data: bytes, at: int) -> tuple[int, int]:
    value = 0
    for i in range(8):
        byte = data[at + i]
        value = value << 7 | byte & 0x7F
        if byte < 0x80:
            return value, at + i + 1
    return value << 8 | data[at + 8], at + 9
