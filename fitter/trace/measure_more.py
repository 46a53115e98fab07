"""Where more observations would show most of a shape: those that narrow its band most, all along it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from rig.fitter import ties
from rig.fitter.arrays import FloatArray, IntArray

PLACES = 3
"""Places that are proposed."""
WORTH = 0.05
"""Least part by which the band must become narrower to be worth saying."""
ANOTHER_ORDER = (
    "another run with its points in another order: what comes back at the same {label} is of it, and what comes back "
    "at the same points is of them"
)


class Settable(Protocol):
    """The used part of an axis."""

    @property
    def label(self) -> str:
        """For people."""

    @property
    def unit(self) -> str:
        """Its values."""

    @property
    def settable(self) -> bool:
        """Whether it can be set."""


@dataclass(frozen=True, eq=False)
class Added:
    """A shape with its error.

    Attributes:
        columns: (m, q) of each cell, response's unit per coefficient.
        spread: (q, q) covariance of the coefficients.
        scatter: of one observation, response's unit.
        rows: (m,) observations of each cell.
        x: (m,) its value of the variable.
        y: (m,) of the second one; empty for a curve.

    """

    columns: FloatArray
    spread: FloatArray
    scatter: float
    rows: IntArray
    x: FloatArray
    y: FloatArray


def measure_more(shape: Added, over: Settable, beside: Settable | None) -> str:
    """A sentence on the cells where more observations narrow the band most; "" where none do.

    The gain is that of the shape's own prior and scatter: what other shape there is between cells it does not know.
    """
    if not over.settable:
        return ANOTHER_ORDER.format(label=over.label)
    spread, each = shape.spread.copy(), max(int(np.median(shape.rows)), 1)
    before, picked = _width(shape.columns, spread), list[int]()
    for _ in range(PLACES):
        towards = shape.columns @ spread @ shape.columns.T
        gain = np.sum(towards**2, axis=1) / (np.diag(towards) + shape.scatter**2 / each)
        k = ties.highest(gain, float(np.max(gain)))
        own = shape.columns[k] @ spread
        spread = spread - np.outer(own, own) / (own @ shape.columns[k] + shape.scatter**2 / each)
        picked.append(k)
    narrower = 1.0 - _width(shape.columns, spread) / before if before > 0 else 0.0
    if narrower < WORTH:
        return ""
    at = _places(shape, sorted(set(picked)), over, beside)
    many = f"{each} more observations each" if each > 1 else "one more observation"
    return f"{many} at {at} would make its band about {100 * narrower:.0f} % narrower"


def _places(shape: Added, cells: list[int], over: Settable, beside: Settable | None) -> str:
    if beside is None:
        return f"{over.label} {_listed([f'{shape.x[k]:.4g}' for k in cells])} {over.unit}".rstrip()
    unit = f" {beside.unit}" if beside.unit else ""
    own = [f"{shape.x[k]:.4g} {over.unit}".rstrip() + f" with {beside.label} {shape.y[k]:.4g}{unit}" for k in cells]
    return f"{over.label} {_listed(own)}"


def _listed(texts: list[str]) -> str:
    return " and ".join([", ".join(texts[:-1]), texts[-1]] if len(texts) > 1 else texts)


def _width(columns: FloatArray, spread: FloatArray) -> float:
    return float(np.mean(np.sqrt(np.maximum(np.einsum("mi,ij,mj->m", columns, spread, columns), 0.0))))
