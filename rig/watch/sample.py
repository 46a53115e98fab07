"""A bounded number of observations that stands for all of them, however long the run."""

from __future__ import annotations

import heapq
from collections import deque

KEPT = 500
"""Observations kept out of all; every one is as likely to be among them as any other."""
RECENT = 100
"""The last ones, which are always there."""


class Sample:
    """Which observations the page shows: `KEPT` of all and the last `RECENT`, by record number.

    The choice is by a hash of the record's number, so that a restarted server shows the same points, and a design that
    repeats itself every so many points does not meet a sample that does so too.
    """

    def __init__(self) -> None:
        self._heap: list[tuple[int, int]] = []
        self._recent: deque[int] = deque(maxlen=RECENT)

    def add(self, seq: int) -> None:
        """Consider one more accepted observation."""
        self._recent.append(seq)
        item = (-_hash(seq), seq)  # a heap's first is its smallest; ours is to be the largest hash
        if len(self._heap) < KEPT:
            heapq.heappush(self._heap, item)
        elif item > self._heap[0]:
            heapq.heapreplace(self._heap, item)

    def seqs(self) -> set[int]:
        """Numbers of the records chosen."""
        return {seq for _, seq in self._heap}.union(self._recent)


def _hash(number: int) -> int:
    """Splitmix64: numbers next to one another come out far apart."""
    mask = (1 << 64) - 1
    z = (number + 0x9E3779B97F4A7C15) & mask
    z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & mask
    z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & mask
    return z ^ (z >> 31)
