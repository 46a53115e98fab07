"""Sets and counts of point indexes: a byte a point where a run is dense, nothing where it is not.

A set of a million integers takes a hundred megabytes. These take one, and an index out of all bounds, as a damaged
or edited file may hold, costs no more than another block.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, MutableMapping, MutableSet

_BITS = 12
_BLOCK = 1 << _BITS
_OTHER = 255
"""Stands for a count that does not fit into a byte."""


class _Blocks:
    """A byte for every integer, 0 until it is set; kept in blocks where any is not 0."""

    def __init__(self) -> None:
        self._blocks: dict[int, bytearray] = {}
        self._used = 0

    def get(self, index: int) -> int:
        block = self._blocks.get(index >> _BITS)
        return block[index & _BLOCK - 1] if block else 0

    def set(self, index: int, value: int) -> None:
        at = index & _BLOCK - 1
        block = self._blocks.get(index >> _BITS)
        if block is None:
            block = self._blocks[index >> _BITS] = bytearray(_BLOCK)
        self._used += bool(value) - bool(block[at])
        block[at] = value

    def __len__(self) -> int:
        return self._used

    def __iter__(self) -> Iterator[int]:
        for number, block in sorted(self._blocks.items()):
            yield from (number * _BLOCK + at for at, value in enumerate(block) if value)


class IndexSet(MutableSet[int]):
    """A set of integers that are mostly close together; iterates in ascending order."""

    def __init__(self, indexes: Iterable[int] = ()) -> None:
        self._flags = _Blocks()
        for index in indexes:
            self.add(index)

    def __contains__(self, index: object) -> bool:
        return isinstance(index, int) and bool(self._flags.get(index))

    def __iter__(self) -> Iterator[int]:
        return iter(self._flags)

    def __len__(self) -> int:
        return len(self._flags)

    def __repr__(self) -> str:
        return f"IndexSet({list(self)})"

    def add(self, value: int) -> None:
        """Put an index in."""
        self._flags.set(value, 1)

    def discard(self, value: int) -> None:
        """Take an index out, if it is in."""
        if value in self:
            self._flags.set(value, 0)

    def difference_update(self, indexes: Iterable[int]) -> None:
        """Take all of `indexes` out."""
        for index in indexes:
            self.discard(index)

    def intersection(self, indexes: Iterable[int]) -> set[int]:
        """Those of `indexes` that are in."""
        return {index for index in indexes if index in self}


class IndexCounts(MutableMapping[int, int]):
    """A count for each of many integers that are mostly close together; counts are mostly small."""

    def __init__(self) -> None:
        self._counts = _Blocks()
        self._others: dict[int, int] = {}

    def __getitem__(self, index: int) -> int:
        count = self._counts.get(index)
        if not count:
            raise KeyError(index)
        return self._others[index] if count == _OTHER else count

    def __setitem__(self, index: int, count: int) -> None:
        small = 0 < count < _OTHER
        self._counts.set(index, count if small else _OTHER)
        if small:
            self._others.pop(index, None)
        else:
            self._others[index] = count

    def __delitem__(self, index: int) -> None:
        if not self._counts.get(index):
            raise KeyError(index)
        self._counts.set(index, 0)
        self._others.pop(index, None)

    def __iter__(self) -> Iterator[int]:
        return iter(self._counts)

    def __len__(self) -> int:
        return len(self._counts)
