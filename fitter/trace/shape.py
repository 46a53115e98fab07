"""A shape without a name as an answer of its own: the curve or surface with its band, its size, the nearest names.

The curve is the mean of a Gaussian process of the waves of the place where it lives, its band that process's own
standard error (Wahba, J. R. Stat. Soc. B 45 (1983) 133), which has its 95 % on average over the curve (Nychka, J. Am.
Stat. Assoc. 83 (1988) 1134). It is drawn as the model leaves it, beside the residual's means in the same cells.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from rig.fitter import ties
from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.linear import orthonormal
from rig.fitter.trace.flexible import DECAYS, HYPER, SIZES
from rig.fitter.trace.measure_more import Added, measure_more

OWN_CELLS, CELLS = 40, 24
"""Distinct values of a variable with a cell each, at most; cells of equal numbers of rows where there are more."""
OWN_LINES, LINES = 13, 6
"""The same for a second variable."""
NAMES = 3
"""Nearest names that are told."""
SAME_DIGITS = 9
"""Digits in which names explain the same of a shape: the first in the catalogue is told first."""
LEAST = 0.05
"""Share of a shape below which a name is not near it."""
LEFT = 1e-2
"""Share of a name's column that must be left beside the model."""


@dataclass(frozen=True, eq=False)
class Axis:
    """A variable over which a shape is drawn.

    Attributes:
        variable: its key, a column of the data.
        label: for people, without the unit.
        unit: "" for a plain number.
        values: (n,) in `unit`.
        settable: whether the bench, or the person who makes the table, sets it.

    """

    variable: str
    label: str
    unit: str
    values: FloatArray
    settable: bool = False

    @property
    def title(self) -> str:
        """Label with the unit."""
        return f"{self.label} / {self.unit}" if self.unit else self.label

    def to_json(self, x: FloatArray) -> dict[str, Any]:
        """With its value (m,) in each cell."""
        return {"variable": self.variable, "label": self.label, "unit": self.unit, "x": x.tolist()}


@dataclass(frozen=True)
class Near:
    """A name of the catalogue beside a shape.

    Attributes:
        effect: its name.
        explains: share of the shape's square that its best columns take up.
        behind: standard errors of what the shape explains beyond it, columns paid for.

    """

    effect: str
    explains: float
    behind: float


@dataclass(frozen=True, eq=False)
class Shape:
    """A shape without a name over one variable, or two.

    Attributes:
        over: the variable.
        beside: a second one; None for a curve.
        x: (m,) of the variable in each cell.
        y: (m,) of the second one; empty for a curve.
        estimate: (m,) the shape, in `unit`.
        stderr: (m,) its standard error.
        mean: (m,) mean residual of each cell.
        mean_stderr: (m,) its standard error by scatter alone.
        rows: (m,) observations in each cell.
        unit: of the response.
        rms: of the shape over all rows, in `unit`.
        p: probability of so much by chance, over all places that were looked at.
        stratum: where it was seen.
        nearest: names, the nearest first; at most three.
        more: what measurement would show more.
        near: all names that are near it.

    """

    over: Axis
    beside: Axis | None
    x: FloatArray
    y: FloatArray
    estimate: FloatArray
    stderr: FloatArray
    mean: FloatArray
    mean_stderr: FloatArray
    rows: IntArray
    unit: str
    rms: float
    p: float
    stratum: str
    nearest: tuple[Near, ...] = ()
    more: str = ""
    near: frozenset[str] = frozenset()

    def to_json(self) -> dict[str, Any]:
        """JSON values; arrays have one number for each cell."""
        return {
            "stratum": self.stratum,
            "p": self.p,
            "rms": self.rms,
            "unit": self.unit,
            "over": self.over.to_json(self.x),
            "beside": None if self.beside is None else self.beside.to_json(self.y),
            "estimate": self.estimate.tolist(),
            "stderr": self.stderr.tolist(),
            "residual": self.mean.tolist(),
            "residual_stderr": self.mean_stderr.tolist(),
            "rows": self.rows.tolist(),
            "nearest": [
                {"effect": one.effect, "explains": one.explains, "behind_sigmas": one.behind} for one in self.nearest
            ],
            "nearest_sentence": nearest_sentence(self.nearest),
            "measure": self.more,
        }


@dataclass(frozen=True, eq=False)
class ResidualAndWaves:
    """A residual and the waves of a place, as the model leaves them.

    Attributes:
        plain: (n,) residual in the response's unit.
        plain_columns: (n, q) waves in the same unit.
        white: (m,) residual in the metric of the stratum, any scale.
        white_columns: (m, q) waves in it.
        roughness: (q,) of the waves.
        df: degrees of freedom of the residual.

    """

    plain: FloatArray
    plain_columns: FloatArray
    white: FloatArray
    white_columns: FloatArray
    roughness: FloatArray
    df: int


Name = tuple[str, FloatArray, FloatArray]
"""Name of an effect; (m, d) its columns for one value of its constant, in the metric, beside the model; (d,) their
lengths before the model was taken out."""


def shape_of(
    seen: ResidualAndWaves,
    over: Axis,
    beside: Axis | None,
    names: Iterable[Name],
    *,
    unit: str,
    p: float,
    stratum: str,
) -> Shape | None:
    """The shape that a residual follows at a place; None where the likeliest one is nothing.

    Args:
        seen: residual and waves.
        over: the variable of the place, (n,) rows.
        beside: a second one; None for a curve.
        names: of the catalogue, once for each value of a searched constant.
        unit: of the response.
        p: see `Shape`.
        stratum: see `Shape`.

    """
    basis = orthonormal(seen.white_columns, None, 1e-6)
    along = basis.T @ seen.white
    df = max(seen.df - basis.shape[1], 1)
    error = float(np.sqrt(max(float(seen.white @ seen.white - along @ along), 0.0) / df))
    if error <= 0 or not basis.shape[1]:
        return None
    y = seen.white / error
    fitted = smoothed(y, seen.white_columns, seen.roughness)
    if fitted is None:
        return None
    coefficients, spread = fitted[0] * error, fitted[1] * error**2
    cell, x, other, rows = _cells(over, beside)
    columns = np.column_stack([np.bincount(cell, one, rows.size) / rows for one in seen.plain_columns.T])
    residual = seen.plain - seen.plain_columns @ coefficients
    scatter = float(np.sqrt(np.mean(residual**2) * seen.white.size / df))
    whole = seen.plain_columns @ coefficients
    form = seen.white_columns @ coefficients
    near = explained(form, names)
    told = measure_more(Added(columns, spread, scatter, rows, x, other), over, beside)
    return Shape(
        over=over,
        beside=beside,
        x=x,
        y=other,
        estimate=columns @ coefficients,
        stderr=np.sqrt(np.maximum(np.einsum("mi,ij,mj->m", columns, spread, columns), 0.0)),
        mean=np.bincount(cell, seen.plain, rows.size) / rows,
        mean_stderr=scatter / np.sqrt(rows),
        rows=rows,
        unit=unit,
        rms=float(np.sqrt(np.mean(whole**2))),
        p=p,
        stratum=stratum,
        nearest=nearest(near, y, basis),
        near=frozenset(near),
        more=told,
    )


def smoothed(y: FloatArray, columns: FloatArray, roughness: FloatArray) -> tuple[FloatArray, FloatArray] | None:
    """Mean (q,) and covariance (q, q) of the coefficients of smooth columns (n, q), y (n,) of unit error.

    Prior as in `rig.fitter.trace.flexible.evidence`, at its likeliest size and decay; None where that is no shape.
    """
    typical = float(np.max(np.linalg.norm(columns, axis=0), initial=0.0))
    if typical <= 0:
        return None
    gram, along = columns.T @ columns / typical**2, columns.T @ y / typical
    best, found = HYPER, None
    for decay in DECAYS if np.ptp(roughness) > 0 else (0.0,):
        falls = roughness**-decay
        values, vectors = np.linalg.eigh(gram * np.outer(falls, falls))
        values, turned = np.maximum(values, 0.0), vectors.T @ (falls * along)
        one = 1.0 + SIZES[:, None] * values
        likely = 0.5 * np.sum(SIZES[:, None] * turned**2 / one - np.log(one), axis=1)
        k = ties.highest(likely)
        if ties.below(best, float(likely[k])):
            best, inverse, back = float(likely[k]), SIZES[k] / one[k], falls[:, None] * vectors / typical
            found = back @ (inverse * turned), (back * inverse) @ back.T
    return found


def explained(form: FloatArray, names: Iterable[Name]) -> dict[str, tuple[float, FloatArray]]:
    """Names near a shape: the share of its square that each explains, and (m, d) its basis at its best constant.

    Args:
        form: (m,) the shape in the metric.
        names: of the catalogue.

    """
    square = float(form @ form)
    best: dict[str, tuple[float, FloatArray]] = {}
    if square <= 0:
        return best
    for name, columns, length in names:
        own = orthonormal(columns, length, LEFT)
        explains = float(np.sum((own.T @ form) ** 2)) / square
        if explains > max(best[name][0] if name in best else 0.0, LEAST):
            best[name] = explains, own
    return best


def nearest(near: dict[str, tuple[float, FloatArray]], y: FloatArray, basis: FloatArray) -> tuple[Near, ...]:
    """The names that explain most of a shape, at most three.

    Args:
        near: from `explained`.
        y: (m,) residual in the metric, of unit error.
        basis: (m, r) orthonormal, of the shape's waves.

    """
    ranked = sorted(near.items(), key=lambda item: -round(item[1][0], SAME_DIGITS))[:NAMES]
    return tuple(Near(name, min(explains, 1.0), _behind(own, y, basis)) for name, (explains, own) in ranked)


def standing_for(names: tuple[str, ...], lefts: Iterable[tuple[str, Shape | None]]) -> tuple[str, Shape] | None:
    """The first of some places, in words, whose shape may stand for effects: one of them at least is near it."""
    return next(((text, shape) for text, shape in lefts if shape is not None and shape.near & set(names)), None)


def nearest_sentence(found: tuple[Near, ...]) -> str:
    """How far off the nearest names are."""
    if not found:
        return f"nearest: none; no name explains as much as {LEAST:.0%} of it".replace("%", " %")
    first, *others = found
    text = (
        f"nearest: {first.effect} explains {int(100 * first.explains)} % of it, and is left behind by "
        f"{first.behind:.1f} standard errors"
    )
    then = (f"{one.effect} ({int(100 * one.explains)} %, {one.behind:.1f})" for one in others)
    return text + (f"; then {' and '.join(then)}" if others else "")


def _behind(own: FloatArray, y: FloatArray, basis: FloatArray) -> float:
    beyond = orthonormal(basis - own @ (own.T @ basis), np.ones(basis.shape[1]), LEFT)
    gain = float(np.sum((beyond.T @ y) ** 2)) - beyond.shape[1]
    return float(np.sqrt(max(gain, 0.0)))


def _cells(over: Axis, beside: Axis | None) -> tuple[IntArray, FloatArray, FloatArray, IntArray]:
    """(n,) cell of each row; (m,) its value of the variable, of the second one, and its rows."""
    first = _binned(over.values, OWN_CELLS, CELLS)
    second = np.zeros_like(first) if beside is None else _binned(beside.values, OWN_LINES, LINES)
    index = second * (1 + int(first.max())) + first
    cell = np.asarray(np.unique(index, return_inverse=True)[1], np.int64)
    rows = np.bincount(cell)
    if beside is None:
        return cell, np.bincount(cell, over.values) / rows, np.empty(0), rows
    one = np.unique(cell, return_index=True)[1]
    return cell, _typical(over.values, first)[one], _typical(beside.values, second)[one], rows


def _typical(values: FloatArray, index: IntArray) -> FloatArray:
    """(n,) mean of the rows of each row's bin."""
    return np.asarray((np.bincount(index, values) / np.bincount(index))[index])


def _binned(values: FloatArray, own: int, parts: int) -> IntArray:
    """(n,) from 0: number of each value, or of its part of the range with as many rows as the others."""
    distinct, index = np.unique(np.round(values, 6), return_inverse=True)
    if distinct.size > own:
        edges = np.unique(np.quantile(values, np.linspace(0, 1, parts + 1)[1:-1]))
        index = np.unique(np.searchsorted(edges, values, side="right"), return_inverse=True)[1]
    return np.asarray(index, np.int64)
