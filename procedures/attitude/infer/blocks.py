"""Blocks of many readings on all cores: they are independent, and NumPy computes without holding the interpreter."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np

BLOCK = 32768
"""Readings of a block: 10 MB of memory while it is computed. Threads of smaller ones wait for one another."""

_WORKERS, _BLOCKS_EACH = 4, 2
"""Most threads, and fewest blocks of each: below, starting one takes longer than it saves."""


def cores() -> int:
    """Cores that this process may use; where the system does not say, those of the machine."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def in_blocks(n: int, infer: Callable[[slice], None]) -> None:
    """Apply `infer` to all blocks of n readings; where it cannot compute, without warnings.

    At most four threads, as many as this process has cores, end with the call; one core or few readings take none.
    """

    def quietly(start: int) -> None:
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            infer(slice(start, start + BLOCK))

    starts = range(0, n, BLOCK)
    workers = min(_WORKERS, cores(), len(starts) // _BLOCKS_EACH)
    if workers > 1:
        with ThreadPoolExecutor(workers) as pool:
            deque(pool.map(quietly, starts), maxlen=0)
    else:
        for start in starts:
            quietly(start)
