"""An order that begins anew in each replication or whole plot, counted through the run."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from rig.fitter.arrays import FloatArray, IntArray


def counts_through(order: FloatArray | IntArray) -> bool:
    """Whether every position occurs once."""
    return bool(np.unique(order).size == np.size(order))


def through(
    order: FloatArray | IntArray, blocks: Iterable[IntArray], time: FloatArray | None = None
) -> IntArray | None:
    """Positions counted through the run, from 1.

    Args:
        order: (n,) positions, which begin anew in each block.
        blocks: (n,) identities of blocks, ascending in time, by possible kind of block.
        time: (n,) time of each row, if known; it gives the order of the blocks if it agrees with their positions.

    Returns:
        (n,); None if a position occurs twice in the blocks of every kind.
    """
    for block in blocks:
        if np.unique(np.column_stack([block, order]), axis=0).shape[0] < np.size(order):
            continue
        by_block = np.lexsort((order, block))
        if time is not None and counts_through(time):
            steps = np.diff(np.asarray(time)[by_block])
            if (steps[np.diff(block[by_block]) == 0] > 0).all():
                by_block = np.argsort(time, kind="stable")
        found = np.empty(np.size(order), np.int64)
        found[by_block] = np.arange(1, np.size(order) + 1)
        return found
    return None
