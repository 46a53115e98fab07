"""A long column with few different values, packed: a run list of a million points takes a few bytes per point."""

from __future__ import annotations

from array import array
from collections.abc import Hashable, Iterator, Sequence
from typing import Generic, TypeVar

Level = TypeVar("Level", bound=Hashable)

_WIDER = {"B": "H", "H": "I", "I": "Q"}


class Coded(Generic[Level]):
    """Values in order, each stored as the number of its level.

    Attributes:
        levels: the different values, in order of first appearance.
    """

    def __init__(self) -> None:
        self.levels: list[Level] = []
        self._code_of: dict[Level, int] = {}
        self._codes = array("B")

    def extend(self, values: Sequence[Level]) -> None:
        """Append values."""
        for value in dict.fromkeys(values):
            if value not in self._code_of:
                self._code_of[value] = len(self.levels)
                self.levels.append(value)
        while len(self.levels) > 1 << 8 * self._codes.itemsize:
            self._codes = array(_WIDER[self._codes.typecode], self._codes)
        self._codes.extend(map(self._code_of.__getitem__, values))

    def first(self, code: int) -> int:
        """Index of the first value of this level."""
        return self._codes.index(code)

    def count(self, code: int) -> int:
        """Number of values of this level."""
        return self._codes.count(code)

    def __len__(self) -> int:
        return len(self._codes)

    def __getitem__(self, index: int) -> Level:
        return self.levels[self._codes[index]]

    def __iter__(self) -> Iterator[Level]:
        return map(self.levels.__getitem__, self._codes)

    def codes(self) -> Iterator[int]:
        """The number of each value's level, in order."""
        return iter(self._codes)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Coded):
            return NotImplemented
        return self.levels == other.levels and self._codes == other._codes

    __hash__ = None  # type: ignore[assignment]
