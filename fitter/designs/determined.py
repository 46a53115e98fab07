"""Terms that a design does not determine, points that would, and degrees of freedom."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import block_array, coo_array
from scipy.sparse.csgraph import connected_components

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.designs.region import DEPENDENT, lost_directions


@dataclass(frozen=True)
class Freedom:
    """Degrees of freedom of a design: ranks of X (terms), T (one column a distinct point) and Z (one a whole plot).

    S. G. Gilmour and L. A. Trinca, Commun. Statist. Theory Methods 29 (2000) 2157. Independent points have no Z.

    Attributes:
        residual: for the error within whole plots, n - rank[X Z].
        whole_plots: for the error between whole plots, rank[X Z] - rank X; None without whole plots.
        pure_error: of points repeated in one whole plot or across repeated ones, n - rank[T Z].
        whole_plot_pure_error: of repeated whole plots, rank[T Z] - rank T; None without whole plots.
        lack_of_fit: distinct points beyond the terms, rank T - rank X.
    """

    residual: int
    whole_plots: int | None
    pure_error: int
    whole_plot_pure_error: int | None
    lack_of_fit: int


def freedom(rows: FloatArray, points: FloatArray, whole_plot: IntArray | None) -> Freedom:
    """Degrees of freedom of (n, k) points with (n, p) rows of the model; `whole_plot` (n,) from 0."""
    n = len(points)
    at = np.unique(points, axis=0, return_inverse=True)[1].reshape(-1)
    terms, distinct = _rank(rows), int(at.max()) + 1
    if whole_plot is None:
        return Freedom(n - terms, None, n - distinct, None, distinct - terms)
    size = np.bincount(whole_plot)
    means = np.stack([np.bincount(whole_plot, column) / size for column in rows.T], axis=1)
    both = size.size + _rank(rows - means[whole_plot], np.linalg.norm(rows, axis=0))
    # one column a point and one a whole plot: every connected part of their table has one dependence
    table = coo_array((np.ones(n), (at, whole_plot)), (distinct, size.size))
    parts = connected_components(block_array([[None, table], [table.T, None]]), directed=False)[0]
    saturated = distinct + size.size - int(parts)
    return Freedom(n - both, both - terms, n - saturated, saturated - distinct, distinct - terms)


def points_that_would(rows: FloatArray, candidates: FloatArray) -> IntArray:
    """Indices of the fewest (C, p) candidate rows that determine what (n, p) rows do not; empty if nothing is missing.

    Each is, in turn, the one with the largest part in the directions still missing, the first of equal ones.
    """
    lost = lost_directions(rows)
    if not lost.shape[1]:
        return np.empty(0, np.int64)
    length = np.linalg.norm(rows, axis=0)
    seen = (candidates / np.where(length > 0.0, length, 1.0)) @ lost
    chosen: list[int] = []
    least = 0.0
    while len(chosen) < lost.shape[1]:
        size = np.linalg.norm(seen, axis=1)
        least = least or DEPENDENT * max(float(size.max()), 1.0)
        best = int(np.argmax(np.round(size, 10)))  # rounding, which differs by processor, decides nothing
        if size[best] <= least:
            break
        chosen.append(best)
        along = seen[best] / size[best]
        seen = seen - np.outer(seen @ along, along)
    return np.array(chosen, np.int64)


def _rank(columns: FloatArray, length: FloatArray | None = None) -> int:
    """Rank of (n, p) columns, in units of their own `length` (p,) or a given one."""
    length = np.linalg.norm(columns, axis=0) if length is None else length
    values = np.linalg.svd(columns / np.where(length > 0.0, length, 1.0), compute_uv=False)
    return int(np.sum(values > DEPENDENT))
