"""Deviating rows that are no gross errors: neighbours in an abscissa on a smooth curve, which the model lacks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.gross.forward_search import GrossErrors
from rig.fitter.gross.rows import Rows

FEWEST = 5
"""Minimum number of named rows in a smooth curve."""
JUMP, NOISE = 0.5, 4.0
"""Maximum difference between neighbours of a smooth curve: relative to its height, or in standard deviations."""


def without_smooth(found: GrossErrors, rows: Rows, abscissae: FloatArray) -> GrossErrors:
    """The gross errors without those rows that deviate along a smooth curve; these are kept apart.

    A gross error is a jump between neighbours. Where neighbours on one side of the model differ by little, up to the
    rows beside them that are not named, it is a shape.

    Args:
        found: rows that deviate.
        rows: of the model.
        abscissae: (n, k) columns by which rows may be neighbours.
    """
    if found.rows.size < FEWEST:
        return found
    kept = np.setdiff1d(np.arange(len(rows.y)), found.rows)
    left = np.zeros(len(rows.y))
    left[kept], left[found.rows] = rows.some(kept).residual, found.off
    left, sd = left / rows.weight, float(np.median(found.sd[kept] / rows.weight[kept]))
    named = np.isin(np.arange(len(left)), found.rows)
    smooth = np.zeros(len(left), bool)
    for column in abscissae.T:
        if np.ptp(column) > 0.0:
            order = np.argsort(column, kind="stable")
            smooth[order[_runs(left[order], named[order], sd)]] = True
    stays = ~smooth[found.rows]
    if stays.all():
        return found
    together = np.union1d(found.together, found.rows[~stays])
    parts = (found.rows[stays], found.distance_sd[stays], found.off[stays])
    return replace(found, rows=parts[0], distance_sd=parts[1], off=parts[2], together=together)


def _runs(left: FloatArray, named: NDArray[np.bool_], sd: float) -> IntArray:
    """Places of named rows in smooth runs of (n,) deviations of one sign."""
    ends = np.r_[0, np.flatnonzero(np.diff(np.sign(left))) + 1, len(left)]
    places = []
    for first, last in zip(ends[:-1].tolist(), ends[1:].tolist(), strict=True):
        inside = first + np.flatnonzero(named[first:last])
        jumps = np.abs(np.diff(left[max(first - 1, 0) : last + 1]))
        if inside.size >= FEWEST and jumps.max() <= max(JUMP * np.abs(left[first:last]).max(), NOISE * sd):
            places.append(inside)
    return np.concatenate([np.zeros(0, np.int64), *places])
