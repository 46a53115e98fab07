"""Rows of a run file read from its pages, without SQLite, which stops at the first thing that is wrong.

By the file format (https://www.sqlite.org/fileformat2.html#b_tree_pages): the cells of table leaf pages, with their
overflow pages. Nothing of it is believed: what a row is worth is for its reader to prove.
"""

from __future__ import annotations

import mmap
import os
import struct
from collections.abc import Iterator
from pathlib import Path

Value = int | float | str | bytes | None
Row = tuple[int, tuple[Value, ...]]
"""Row number and columns, as stored."""

_PAGE = 4096
"""What run files are made with; a header that says otherwise is damaged, or from elsewhere."""
_WAL_HEADER, _FRAME_HEADER = 32, 24
_MOST_COLUMNS = 300
_MOST_BYTES = 64 << 20
_NO_BYTES, _REAL = (0, 8, 9), 7
_INTEGERS = {1: 1, 2: 2, 3: 3, 4: 4, 5: 6, 6: 8}


class Pages:
    """The pages of a file and its log; the latest version of each unless asked for all.

    Args:
        path: the file.

    """

    def __init__(self, path: Path) -> None:
        with path.open("rb") as file:
            size = os.fstat(file.fileno()).st_size
            self._main = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) if size else b""
        self._count = size // _PAGE
        self._frames = list(_logged(path.with_name(path.name + "-wal")))
        self._latest = dict(self._frames)

    def rows(self) -> Iterator[Row]:
        """Every row that can be read, mostly in order; one may come repeatedly, from earlier versions of its page."""
        for number in sorted({*range(1, self._count + 1), *self._latest}):
            yield from _leaf(number, self.page(number), self)
        for number, page in self._frames:
            yield from _leaf(number, page, self)
        for number in self._latest:
            yield from _leaf(number, self._in_main(number), self)

    def page(self, number: int) -> bytes:
        """The latest version of a page, "" if there is none."""
        return self._latest.get(number) or self._in_main(number)

    def _in_main(self, number: int) -> bytes:
        return bytes(self._main[(number - 1) * _PAGE : number * _PAGE]) if 1 <= number <= self._count else b""


def _logged(log: Path) -> Iterator[tuple[int, bytes]]:
    """Pages of a log, oldest first, whether it would be replayed or not."""
    data = log.read_bytes() if log.is_file() else b""
    for at in range(_WAL_HEADER, len(data) - _FRAME_HEADER - _PAGE + 1, _FRAME_HEADER + _PAGE):
        (number,) = struct.unpack_from(">I", data, at)
        yield number, data[at + _FRAME_HEADER : at + _FRAME_HEADER + _PAGE]


def _leaf(number: int, page: bytes, pages: Pages) -> Iterator[Row]:
    """The cells of a page taken for a table's leaf, whatever its header says: that may be what was damaged."""
    if len(page) < _PAGE:
        return
    first = _PAGE
    at = (100 if number == 1 else 0) + 8
    while at + 2 <= first:  # pointers end at the latest where the first cell begins
        (pointer,) = struct.unpack_from(">H", page, at)
        at += 2
        row = _cell(page, pointer, pages) if at <= pointer < _PAGE else None
        if row is not None:
            first = min(first, pointer)
            yield row


def _cell(page: bytes, at: int, pages: Pages) -> Row | None:
    try:
        size, at = _varint(page, at)
        key, at = _varint(page, at)
        payload = _payload(page, at, size, pages)
        return (key, _columns(payload)) if payload is not None else None
    except (IndexError, struct.error, UnicodeDecodeError, ValueError):
        return None


def _payload(page: bytes, at: int, size: int, pages: Pages) -> bytes | None:
    if not 2 <= size <= _MOST_BYTES:
        return None
    most, least = _PAGE - 35, (_PAGE - 12) * 32 // 255 - 23
    if size <= most:
        return page[at : at + size] if at + size <= _PAGE else None
    here = least + (size - least) % (_PAGE - 4)
    here = here if here <= most else least
    if at + here + 4 > _PAGE:
        return None
    types, begin = _types(page[at : at + here])
    if begin + sum(map(_size, types)) != size:  # before pages are followed that nothing leads to
        return None
    found = [page[at : at + here]]
    (following,) = struct.unpack_from(">I", page, at + here)
    left = size - here
    while left > 0:
        more = pages.page(following)
        if len(more) < _PAGE:
            return None
        (following,) = struct.unpack_from(">I", more, 0)
        found.append(more[4 : 4 + min(left, _PAGE - 4)])
        left -= _PAGE - 4
    return b"".join(found)


def _columns(payload: bytes) -> tuple[Value, ...]:
    """A record's columns. Raises ValueError or IndexError if it is none."""
    types, at = _types(payload)
    found: list[Value] = []
    for kind in types:
        value, at = _value(payload, at, kind)
        found.append(value)
    if at != len(payload):
        raise ValueError("no record")
    return tuple(found)


def _types(payload: bytes) -> tuple[list[int], int]:
    """What kind each column is of, and where the first begins. Raises as `_columns`."""
    end, at = _varint(payload, 0)
    if not 1 < end <= min(len(payload), 9 * _MOST_COLUMNS):
        raise ValueError("no record")
    types = []
    while at < end:
        kind, at = _varint(payload, at)
        types.append(kind)
    return types, end


def _size(kind: int) -> int:
    """Bytes of a column of this kind."""
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
