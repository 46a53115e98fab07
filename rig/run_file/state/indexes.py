"""Sets and counts of point indexes: one byte per point in dense parts of a run, nothing elsewhere.

A set of a million integers takes a hundred megabytes. These take one. A huge index, as in a damaged or edited file,
takes only one more block.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, MutableMapping, MutableSet

_BITS = 12
_LOW = (1 << _BITS) - 1
_OTHER = 255
"""Marks a count that does not fit into a byte."""


class _Bytes:
    """One byte per integer, 0 until it is set; stored in blocks with at least one byte that is not 0."""

    def __init__(self) -> None:
        self._blocks: dict[int, bytearray] = {}
        self._used = 0

    def _get(self, index: int) -> int:
        block = self._blocks.get(index >> _BITS)
        return block[index & _LOW] if block else 0

    def _set(self, index: int, byte: int) -> None:
        block = self._blocks.get(index >> _BITS)
        if block is None:
            block = self._blocks[index >> _BITS] = bytearray(1 << _BITS)
        at = index & _LOW
        if not block[at]:
            self._used += 1
        if not byte:
            self._used -= 1
        block[at] = byte

    def __len__(self) -> int:
        return self._used

    def __iter__(self) -> Iterator[int]:
        for number, block in sorted(self._blocks.items()):
            yield from ((number << _BITS) + at for at, byte in enumerate(block) if byte)


class IndexSet(_Bytes, MutableSet[int]):
    """A set of integers that are mostly close together; iterates in ascending order."""

    def __init__(self, indexes: Iterable[int] = ()) -> None:
        super().__init__()
        for index in indexes:
            self.add(index)

    def __contains__(self, index: object) -> bool:
        return isinstance(index, int) and bool(self._get(index))

    def __repr__(self) -> str:
        return f"IndexSet({list(self)})"

    def add(self, value: int) -> None:
        """Add an index."""
        self._set(value, 1)

    def discard(self, value: int) -> None:
        """Remove an index, if it is in the set."""
        if value in self:
            self._set(value, 0)

    def difference_update(self, indexes: Iterable[int]) -> None:
        """Remove all of `indexes`."""
        for index in indexes:
            self.discard(index)

    def intersection(self, indexes: Iterable[int]) -> set[int]:
        """Those of `indexes` that are in the set."""
        return {index for index in indexes if index in self}


class IndexCounts(_Bytes, MutableMapping[int, int]):
    """A count for each of many integers that are mostly close together; counts are mostly small."""

    def __init__(self) -> None:
        super().__init__()
        self._others: dict[int, int] = {}

    def count(self, index: int) -> int:
        """The count of an index; 0 if it has none."""
        count = self._get(index)
        return self._others[index] if count == _OTHER else count

    def __getitem__(self, index: int) -> int:
        if not self._get(index):
            raise KeyError(index)
        return self.count(index)

    def __setitem__(self, index: int, count: int) -> None:
        if 0 < count < _OTHER:
            self._set(index, count)
            if self._others:
                self._others.pop(index, None)
        else:
            self._set(index, _OTHER)
            self._others[index] = count

    def __delitem__(self, index: int) -> None:
        if not self._get(index):
            raise KeyError(index)
        self._set(index, 0)
        self._others.pop(index, None)
