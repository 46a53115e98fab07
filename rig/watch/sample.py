"""A random sample of bounded size of the observations of a run of any length."""

from __future__ import annotations

import heapq
from collections import deque

KEPT = 500
"""Size of the sample; every observation has the same probability to be in it."""
RECENT = 100
"""Number of last observations that are always shown."""


class Sample:
    """Selects the observations shown by the page: `KEPT` of all and the last `RECENT`, by record number.

    The choice is by a hash of the record's number. So a restarted server shows the same points, and a design with a
    period does not meet a sample with the same period.
    """

    def __init__(self) -> None:
        self._heap: list[tuple[int, int]] = []
        self._recent: deque[int] = deque(maxlen=RECENT)

    def add(self, seq: int) -> None:
        """Take one more accepted observation."""
        self._recent.append(seq)
        item = (-_hash(seq), seq)  # the first of a heap is its smallest; here it must be the largest hash
        if len(self._heap) < KEPT:
            heapq.heappush(self._heap, item)
        elif item > self._heap[0]:
            heapq.heapreplace(self._heap, item)

    def seqs(self) -> set[int]:
        """Numbers of the chosen records."""
        return {seq for _, seq in self._heap}.union(self._recent)


def _hash(number: int) -> int:
    """Splitmix64: neighbouring numbers get very different hashes."""
    mask = (1 << 64) - 1
    z = (number + 0x9E3779B97F4A7C15) & mask
    z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & mask
    z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & mask
    return z ^ (z >> 31)
