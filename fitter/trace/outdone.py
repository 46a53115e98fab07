"""Doubtful names that one shape without a name outdoes.

A cause that is in no catalogue is found as the name that is most like it, or as several that imitate it together. All
models are compared that have some of the doubtful names, and one shape without a name or none. Each name has the price
of its choice among all names and values, a shape that of its choice among all places, of its size and of its
smoothness. A name is outdone if a model with a shape and without it is the most probable one. A right name of a second
cause stays: no shape at one place does the work of both.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from rig.fitter import ties
from rig.fitter.arrays import FloatArray
from rig.fitter.trace.flexible import HYPER, of_products

LIKELY = 4
"""Places that are asked with some of the names only: the best ones without any name, and the best beside all."""
LEFT = 1e-8
"""Share of the square of columns that must be left beside others: less is rounding."""


class Shape(NamedTuple):
    """A shape without a name.

    Attributes:
        text: its place in words.
        columns: (m, q) in the metric of the residual.
        roughness: (q,) of each.
        price: of its choice, nats.

    """

    text: str
    columns: FloatArray
    roughness: FloatArray
    price: float


class Weighed(NamedTuple):
    """A model of some names and one shape.

    Attributes:
        names: in the model.
        text: place of the shape; "" for none.
        nats: evidence less prices.

    """

    names: frozenset[str]
    text: str
    nats: float


def outdone(
    y: FloatArray, names: Mapping[str, FloatArray], prices: Mapping[str, float], shapes: Iterable[Shape]
) -> dict[str, str]:
    """Names that one shape without a name outdoes, each with the place of that shape.

    Args:
        y: (m,) residual beside all other names, of unit error.
        names: (m, q) columns of each doubtful name in the same metric.
        prices: of the choice of each name, nats.
        shapes: at all places.

    Example:
        >>> u = np.linspace(-1.0, 1.0, 200)
        >>> waves = np.cos(np.pi * np.arange(1, 9) * (u[:, None] + 1.0) / 2.0)
        >>> bump = Shape("over u", waves, np.arange(1.0, 9.0), 1.0)
        >>> line = {"slope": u[:, None]}
        >>> outdone(20.0 * np.exp(-20.0 * (u - 0.5) ** 2), line, {"slope": 3.0}, [bump])
        {'slope': 'over u'}
        >>> outdone(20.0 * u, line, {"slope": 3.0}, [bump])
        {}

    """
    beside = _Beside(y, names, prices)
    placed = [beside.placed(shape) for shape in shapes if shape.columns.shape[1]]
    every, likely = frozenset(names), set[int]()
    for some in (every, frozenset[str]()):
        nats = np.array([beside.nats(some, one) for one in placed])
        likely.update(ties.descending(nats)[:LIKELY].tolist())
    models = [model for one in (None, *(placed[k] for k in sorted(likely))) for model in _models(beside, one)]
    best = models[ties.highest([one.nats for one in models])]
    return {name: best.text for name in names if best.text and name not in best.names}


class _Placed(NamedTuple):
    shape: Shape
    gram: FloatArray
    along: FloatArray
    cross: FloatArray


class _Beside:
    """Products of names with each other and with the residual."""

    def __init__(self, y: FloatArray, names: Mapping[str, FloatArray], prices: Mapping[str, float]) -> None:
        self.y, self.prices = y, prices
        every = np.column_stack(list(names.values()))
        length = np.linalg.norm(every, axis=0)
        self.columns = every / np.where(length > 0.0, length, 1.0)
        ends = np.cumsum([0, *(one.shape[1] for one in names.values())]).tolist()
        own = map(list, itertools.starmap(range, itertools.pairwise(ends)))
        self.own = dict(zip(names, own, strict=True))
        self.gram, self.along = self.columns.T @ self.columns, self.columns.T @ y
        alone = [self._left(self.gram, self.along, self.gram, own, ()) for own in self.own.values()]
        self.order = [list(names)[k] for k in ties.descending(alone)]
        self._known = dict[frozenset[str], float]()

    def placed(self, shape: Shape) -> _Placed:
        """Products of a shape's columns."""
        columns = shape.columns
        return _Placed(shape, columns.T @ columns, columns.T @ self.y, self.columns.T @ columns)

    def nats(self, names: frozenset[str], placed: _Placed | None) -> float:
        """Evidence of a model less its prices."""
        if names not in self._known:
            total, taken = 0.0, list[int]()
            for name in (one for one in self.order if one in names):
                total += self._left(self.gram, self.along, self.gram, self.own[name], taken) - self.prices[name]
                taken += self.own[name]
            self._known[names] = total
        if placed is None:
            return self._known[names]
        taken = [j for name in self.order if name in names for j in self.own[name]]
        every = list(range(len(placed.along)))
        rough = placed.shape.roughness
        found = self._left(placed.gram, placed.along, placed.cross, every, taken, rough)
        return self._known[names] + found - placed.shape.price

    def _left(
        self,
        gram: FloatArray,
        along: FloatArray,
        cross: FloatArray,
        own: Sequence[int],
        taken: Sequence[int],
        roughness: FloatArray | None = None,
    ) -> float:
        """Evidence of columns beside names that are taken, from products; `cross` is (names' columns, columns)."""
        picked, least = list(own), 0.0 if roughness is None else -HYPER
        left, to_y = gram[np.ix_(picked, picked)], along[picked]
        whole = float(np.max(np.diag(left), initial=0.0))
        if len(taken):
            some = list(taken)
            inverse = np.linalg.pinv(self.gram[np.ix_(some, some)], rcond=LEFT, hermitian=True)
            both = cross[np.ix_(some, picked)]
            left, to_y = left - both.T @ inverse @ both, to_y - both.T @ inverse @ self.along[some]
        longest = float(np.max(np.diag(left), initial=0.0))
        if longest <= LEFT * whole:
            return least
        return of_products(left / longest, to_y / np.sqrt(longest), roughness)


def _models(beside: _Beside, placed: _Placed | None) -> Iterator[Weighed]:
    """Models with one shape: of all names, then of one less and so on, always without the one that is needed least."""
    names, text = frozenset(beside.order), "" if placed is None else placed.shape.text
    yield Weighed(names, text, beside.nats(names, placed))
    while names:
        fewer = [names - {name} for name in beside.order if name in names]
        nats = [beside.nats(one, placed) for one in fewer]
        k = ties.highest(nats)
        names = fewer[k]
        yield Weighed(names, text, nats[k])
