"""Settings that a reference standard read: its readings of one setpoint scatter a little, and are one setting."""

from __future__ import annotations

import numpy as np

from rig.fitter.arrays import FloatArray, IntArray

ALIKE = 2e-3
"""Gap between values, of the range of a column, below which they are one setting."""


def settings_of(columns: FloatArray) -> IntArray:
    """(n,) numbers of settings, from (n, k) columns."""
    numbers = np.column_stack([gathered(column) for column in columns.T])
    return np.asarray(np.unique(numbers, axis=0, return_inverse=True)[1].reshape(-1), np.int64)


def gathered(v: FloatArray) -> IntArray:
    """(n,) numbers of groups of values (n,) without a gap between them."""
    order = np.argsort(v, kind="stable")
    gaps = np.diff(v[order]) > ALIKE * max(float(np.ptp(v)), np.finfo(float).tiny)
    group = np.empty(len(v), np.int64)
    group[order] = np.concatenate([[0], np.cumsum(gaps)])
    return group


def share_within(columns: FloatArray, group: IntArray) -> float:
    """Share of the variation of columns (n, d) that is within groups."""
    count = np.bincount(group)[:, None]
    sums = np.zeros((len(count), columns.shape[1]))
    np.add.at(sums, group, columns)
    within = float(np.sum((columns - (sums / count)[group]) ** 2))
    whole = float(np.sum((columns - columns.mean(axis=0)) ** 2))
    return within / whole if whole > 0.0 else 0.0
