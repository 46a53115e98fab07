"""Which other causes explain the data equally well.

An alias class is every set of candidates which, put in place of an effect and refitted together with all the rest,
comes within `DELTA` of the best residual sum of squares. It is not a threshold on correlations: more data, another
sensor or another order of running separate what a correlation only compares.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from fitter.arrays import FloatArray
from fitter.effects import Entry
from fitter.trace.whitened import Whitened

DELTA = 9.0
"""Units of the error's variance; three standard errors. Calibrated: in 120 runs of 13 x 13 points the true cause lost
its place to a luckier one with more columns 4 times at 6 and once at 9 (python -m benchmarks.bench_fit delta)."""
PER_COLUMN = 2.0
"""Price of a column in the same units, so that a cause with more columns is not better for having them."""


class Named(Protocol):
    """A candidate: one term of an effect, on one sensor or (None) on all."""

    @property
    def effect(self) -> Entry:
        """The catalogue's entry it is a term of."""

    @property
    def sensor(self) -> str | None:
        """The sensor it concerns."""


@dataclass(frozen=True)
class Rival:
    """Another explanation of one effect.

    Attributes:
        effect: its name.
        terms: indices of the candidates that make it up.
        sigmas: how far behind the best explanation it is, in standard errors.

    """

    effect: str
    terms: tuple[int, ...]
    sigmas: float

    @property
    def alias(self) -> bool:
        """Whether the data cannot tell it from the best."""
        return self.sigmas**2 <= DELTA


def rivals(
    candidates: Sequence[Named], white: Whitened, group: tuple[int, ...], rest: tuple[int, ...], sensors: Iterable[str]
) -> tuple[Rival, ...]:
    """All explanations of what the candidates `group`, the terms of one effect, explain, itself included, best first.

    Args:
        candidates: of the run.
        white: outputs and columns beside `rest`, where residual sums of squares are to be compared.
        group: indices of the terms to be replaced.
        rest: indices of the other candidates in the model.
        sensors: those that `group` concerns; candidates of others cannot explain it.

    """
    effect, where = candidates[group[0]].effect.name, {None, *sensors}
    products = _Products.of(white)
    paths = [{group: products.price(group)}]
    for name in dict.fromkeys(c.effect.name for c in candidates):
        if name == effect or any(candidates[j].effect.name == name and candidates[j].sensor in where for j in rest):
            continue
        terms = [j for j, c in enumerate(candidates) if c.effect.name == name and c.sensor in where]
        if terms:
            paths.append(_path(products, terms))
    best = min(min(path.values()) for path in paths)
    explanations = [_smallest(path, best) for path in paths]
    return tuple(
        Rival(candidates[terms[0]].effect.name, terms, float(np.sqrt(price - best)))
        for terms, price in sorted(explanations, key=lambda explanation: explanation[1])
    )


def simplest(candidates: Iterable[Rival]) -> Rival:
    """Of the explanations the data cannot tell apart the one with fewest columns, then first in the catalogue."""
    return min((r for r in candidates if r.alias), key=lambda r: (len(r.terms), min(r.terms)))


@dataclass(frozen=True, eq=False)
class _Products:
    """All that refits need: products of the candidates' columns (J, J), and with the outputs (J,)."""

    columns: FloatArray
    outputs: FloatArray

    @classmethod
    def of(cls, white: Whitened) -> _Products:
        flat = white.columns.reshape(-1, white.columns.shape[2])
        return cls(flat.T @ flat, flat.T @ white.outputs.reshape(-1))

    def price(self, terms: tuple[int, ...]) -> float:
        """Residual sum of squares with `terms` fitted, less that without them, plus the price of the columns."""
        picked = list(terms)
        gram, dot = self.columns[np.ix_(picked, picked)], self.outputs[picked]
        length = np.sqrt(np.maximum(np.diag(gram), np.finfo(float).tiny))
        weights = np.linalg.lstsq(gram / np.outer(length, length), dot / length, rcond=1e-10)[0]
        return float(-weights @ (dot / length)) + PER_COLUMN * len(terms)


def _path(products: _Products, terms: list[int]) -> dict[tuple[int, ...], float]:
    """Price of the best term, of the best two, and so on, taken one after the other while the price falls."""
    path: dict[tuple[int, ...], float] = {}
    taken: tuple[int, ...] = ()
    price = np.inf
    while len(taken) < len(terms):
        tries = {j: products.price((*taken, j)) for j in terms if j not in taken}
        best = min(tries, key=lambda j: tries[j])
        if tries[best] >= price:
            break
        taken, price = (*taken, best), tries[best]
        path[tuple(sorted(taken))] = price
    return path


def _smallest(path: dict[tuple[int, ...], float], best: float) -> tuple[tuple[int, ...], float]:
    """The fewest terms of one cause that come within `DELTA` of the best explanation; else its cheapest."""
    for terms, price in path.items():
        if price - best <= DELTA:
            return terms, price
    return min(path.items(), key=lambda item: item[1])
