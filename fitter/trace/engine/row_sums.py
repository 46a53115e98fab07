"""Sums over the rows of many columns, in one pass through memory."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rig.fitter.arrays import FloatArray, IntArray

AT_ONCE = 32
"""Rows of all candidates that fit the cache."""


class RowSums(NamedTuple):
    """Sums over the rows of columns (n, D).

    Attributes:
        squares: (D,) of their squares.
        total: (D,) of themselves.
        along: (k, D) of their products with a basis.
        across: (p,) of the products within pairs of neighbours.
    """

    squares: FloatArray
    total: FloatArray
    along: FloatArray
    across: FloatArray


def row_sums(columns: FloatArray, basis: FloatArray, first: IntArray) -> RowSums:
    """Of columns (n, D), with a basis (n, k), and of pairs that begin at `first` (p,)."""
    width = columns.shape[1]
    squares, total, along = np.zeros(width), np.zeros(width), np.zeros((basis.shape[1], width))
    across = np.zeros(first.size)
    for rows in stretches(len(columns)):
        some = columns[rows]
        squares += np.einsum("ij,ij->j", some, some)
        total += some.sum(axis=0)
        along += basis[rows].T @ some
        across += np.einsum("ij,ij->j", some[:, first], some[:, first + 1])
    return RowSums(squares, total, along, across)


def pairs(start: IntArray) -> IntArray:
    """(p,) first columns of the candidates of two, from where each begins (J + 1,)."""
    return np.asarray(start[:-1][np.diff(start) == 2])


def stretches(n: int) -> list[slice]:
    """Rows a few at a time, so that they stay in the cache while they are used."""
    return [slice(first, first + AT_ONCE) for first in range(0, n, AT_ONCE)]


def outside(columns: FloatArray, basis: FloatArray) -> FloatArray:
    """Part of columns (n, m) outside an orthonormal basis (n, k), in the columns' own type."""
    basis = basis.astype(columns.dtype, copy=False)
    along, out = basis.T @ columns, np.empty(columns.shape, columns.dtype)
    for rows in stretches(len(columns)):
        np.subtract(columns[rows], basis[rows] @ along, out=out[rows])
    return out
