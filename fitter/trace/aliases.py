"""Other causes that explain the data equally well.

An alias class contains every set of candidates which, in place of an effect and refitted with all the rest, comes
within `DELTA` of the best residual sum of squares. There is no threshold on correlations: more data, another sensor or
another order of running separate causes that a correlation only compares.
"""

from __future__ import annotations

from collections.abc import Generator, Iterable, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from rig.fitter import ties
from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.effects.entry import Entry
from rig.fitter.trace.signs import SURE, Impossible, impossible
from rig.fitter.trace.whitened import Whitened

BoolArray = NDArray[np.bool_]
Path = dict[tuple[int, ...], float]
"""Prices of the best unit of a name, of the best two, and so on, by their terms."""
Paths = dict[str, Path]
Units = list[tuple[int, ...]]

DELTA = 9.0
"""Units of the error's variance; three standard errors. Calibrated: in 120 runs of 13 x 13 points the true cause lost
its place to a luckier one with more columns 4 times at 6 and once at 9: python -m proving attitude width."""
NEARLY = 16.0
"""The same for a cause that the data exclude, but not so clearly that chance and the choice of the best of many could
not have done it: the true cause was 3.1 standard errors behind in one of 24 runs of `confirm pairs`."""
PER_COLUMN = 2.0
"""Price of a column in the same units, so that more columns are no advantage of a cause. A searched constant has the
price of a column.
"""


NOTHING_LEFT = 1e-3
"""A candidate with a smaller remaining share beside the others at a level cannot be judged there."""
APART = 1e-14
"""Largest cosine between columns that are orthogonal but for rounding."""
FEW = 4
"""Number of units below which it is faster not to look for such parts."""
_RCOND = 1e-10
"""Smallest share of the largest eigenvalue that counts in products of columns of unit length."""
_RIDGE = 1e-13
"""Added to all eigenvalues where no more than a bound is asked: what counts loses a thousandth."""


class Named(Protocol):
    """A candidate: one term of an effect, on one sensor or (None) on all."""

    @property
    def effect(self) -> Entry:
        """Catalogue entry of the term."""

    @property
    def sensor(self) -> str | None:
        """Its sensor."""


@dataclass(frozen=True)
class Rival:
    """Another explanation of one effect.

    Attributes:
        effect: its name.
        terms: indices of the candidates that make it up.
        sigmas: standard errors by which it is worse than the best explanation.
        searched: whether a constant in its columns was searched.
        refused: terms that would need a physically impossible sign; such a rival is not an explanation.
    """

    effect: str
    terms: tuple[int, ...]
    sigmas: float
    searched: bool = False
    refused: tuple[Impossible, ...] = ()

    @property
    def alias(self) -> bool:
        """Whether the data cannot distinguish it from the best, and it is physically possible."""
        return not self.refused and self.sigmas**2 <= DELTA

    @property
    def near(self) -> bool:
        """Whether the data exclude it, but barely."""
        return not self.refused and DELTA < self.sigmas**2 <= NEARLY


def rivals(
    candidates: Sequence[Named],
    products: Products,
    group: tuple[int, ...],
    rest: tuple[int, ...],
    sensors: Iterable[str],
    units: Sequence[tuple[int, ...]] = (),
    searched: AbstractSet[str] = frozenset(),
    known: Paths | None = None,
    within: float = np.inf,
) -> tuple[Rival, ...]:
    """All explanations for the candidates `group`, the terms of one effect, including itself, best first.

    Args:
        candidates: of the run.
        products: of their columns and the outputs beside `rest`, for the comparison of residual sums of squares.
        group: indices of the terms to be replaced.
        rest: indices of the other candidates in the model.
        sensors: sensors of `group`; candidates of others cannot explain it.
        units: candidates that enter and leave together; by default each separately.
        searched: effects of which only one unit at a time is possible, because their units are values of one constant.
        known: paths with the same products, units and sensors, by name; those that are not in it are added.
        within: names that cannot come within this of the price of `group`, whatever their terms, are left out.
    """
    effect, where = candidates[group[0]].effect.name, {None, *sensors}
    units = units or [(j,) for j in range(len(candidates))]
    of: dict[str, Units] = {}
    for unit in units:
        if candidates[unit[0]].sensor in where:
            of.setdefault(candidates[unit[0]].effect.name, []).append(unit)
    held = {candidates[j].effect.name for j in rest if candidates[j].sensor in where}
    own = products.price(group) + PER_COLUMN * (effect in searched)
    if np.isfinite(within):
        of = products.able(of, searched, own + within)
    others, known = [name for name in of if name != effect and name not in held], {} if known is None else known
    new = [name for name in others if name not in known]
    known |= dict(zip(new, _paths(products, [(of[name], name in searched) for name in new]), strict=True))
    paths = [{group: own}, *(known[name] for name in others)]
    best = min(min(path.values()) for path in paths if path)
    found = [_rival(candidates, _smallest(path, best), best, searched) for path in paths if path]
    allowed = {rival.effect for rival in found if rival.alias}
    refusable = dict[str, Units]()
    for name, every in of.items():
        terms = [unit for unit in every if not {*unit} & {*rest}]  # a name is found by one term, refused by another
        if name not in allowed and name != effect and terms and products.signed(terms):
            refusable[name] = terms
    free = replace(products, signs=None)
    every_free = _paths(free, [(terms, name in searched) for name, terms in refusable.items()])
    for name, path in zip(refusable, every_free, strict=True):
        fit, price = _smallest(path, best)
        wrong = products.impossible(fit)
        if wrong and price - best <= DELTA:
            found = [rival for rival in found if rival.effect != name]
            found.append(replace(_rival(candidates, (fit, max(price, best)), best, searched), refused=wrong))
    return best_first(found)


def best_first(found: Sequence[Rival]) -> tuple[Rival, ...]:
    """Explanations in order of their price, those that are refused last; equals stay in their order."""
    price = np.array([np.sign(rival.sigmas) * rival.sigmas**2 for rival in found])
    ordered = [found[k] for k in ties.descending(-price)]
    return tuple(sorted(ordered, key=lambda rival: bool(rival.refused)))


def _rival(
    candidates: Sequence[Named], fit: tuple[tuple[int, ...], float], best: float, searched: AbstractSet[str]
) -> Rival:
    terms, price = fit
    name = candidates[terms[0]].effect.name
    behind = price - best if ties.below(best, price) else 0.0
    return Rival(name, terms, float(np.sqrt(behind)), name in searched)


def separation(explanations: Sequence[Rival], name: str) -> dict[str, float]:
    """Standard errors by which every other explanation is worse than the one of this name, by effect."""
    best = next(rival.sigmas for rival in explanations if rival.effect == name)
    others = [rival for rival in explanations if rival.effect != name and not rival.refused]
    return {rival.effect: round(max(rival.sigmas - best, 0.0), 2) for rival in others}


def simplest(candidates: Iterable[Rival]) -> Rival:
    """The indistinguishable explanation with the fewest columns, then the first in the catalogue."""
    return min((r for r in candidates if r.alias), key=lambda r: (len(r.terms) + r.searched, min(r.terms)))


@dataclass(frozen=True, eq=False)
class Products:
    """Data for refits.

    Attributes:
        columns: (J, J) products of the candidates' columns.
        outputs: (J,) of these and the outputs.
        signs: (J,) physical signs of coefficients, 0 for either; None without a check.
    """

    columns: FloatArray
    outputs: FloatArray
    signs: FloatArray | None = None

    def signed(self, units: Iterable[tuple[int, ...]]) -> bool:
        """Whether any of these candidates has a physical sign."""
        return self.signs is not None and any(self.signs[j] for unit in units for j in unit)

    def impossible(self, terms: tuple[int, ...]) -> tuple[Impossible, ...]:
        """Those of `terms`, fitted together, whose sign is certainly wrong."""
        return () if self.signs is None else impossible(self.columns, self.outputs, terms, self.signs)

    @classmethod
    def of(
        cls, white: Whitened, weight: FloatArray | None = None, among: tuple[IntArray, int] | None = None
    ) -> Products:
        """Products of outputs and columns over all sensors together, each with its weight (S,).

        Most candidates belong to one sensor and are zero on the others, so each sensor's own block is multiplied alone.
        With `among`, the number of each column among so many candidates; products of the others are zero.
        """
        weight = np.ones(len(white.outputs)) if weight is None else weight
        number, count = among or (np.arange(white.columns.shape[2]), white.columns.shape[2])
        products, outputs = np.zeros((count, count)), np.zeros(count)
        for columns, y, each in zip(white.columns, white.outputs, weight.tolist(), strict=True):
            mine = np.flatnonzero(columns.any(axis=0))
            own, at = columns[:, mine], number[mine]
            products[np.ix_(at, at)] += each * (own.T @ own)
            outputs[at] += each * (own.T @ y)
        return cls(products, outputs)

    def without(self, length2: FloatArray) -> Products:
        """The same, without columns of which next to nothing remains: that is rounding.

        Args:
            length2: (..., J) squared length of each column before removing others.
        """
        kept = np.where(np.einsum("...jj->...j", self.columns) <= NOTHING_LEFT**2 * length2, 0.0, 1.0)
        return replace(
            self, columns=self.columns * kept[..., :, None] * kept[..., None, :], outputs=self.outputs * kept
        )

    def able(self, of: dict[str, Units], searched: AbstractSet[str], most: float) -> dict[str, Units]:
        """Those of several names whose price can be as low as this: with all their terms together, of the price of one.

        Of names with a searched constant, of which one unit counts, nothing is said.
        """
        columns = {name: [j for unit in units for j in unit] for name, units in of.items() if name not in searched}
        none = set[str]()
        for width in {len(own) for own in columns.values()}:
            same = [name for name, own in columns.items() if len(own) == width]
            picked = np.array([columns[name] for name in same], np.int64)
            gram = self.columns[picked[:, :, None], picked[:, None, :]]
            length = np.sqrt(np.maximum(np.einsum("ujj->uj", gram), np.finfo(float).tiny))
            gram, dot = gram / (length[:, :, None] * length[:, None, :]), self.outputs[picked] / length
            weights = np.linalg.solve(gram + _RIDGE * np.eye(width), dot[:, :, None])[:, :, 0]
            gain = np.sum(weights * dot, axis=1) * (1.0 + 2.0 * _RIDGE / _RCOND)
            none |= {name for name, one in zip(same, gain.tolist(), strict=True) if PER_COLUMN - one > most}
        return {name: units for name, units in of.items() if name not in none}

    def parts(self, units: Sequence[tuple[int, ...]]) -> IntArray:
        """(U,) number of the part of each of the units, of parts whose columns are orthogonal but for rounding.

        Columns of several sensors are, and a fit to all of them is one to each.
        """
        if len(units) < FEW:
            return np.zeros(len(units), np.int64)
        columns, of = (
            [j for unit in units for j in unit],
            np.repeat(np.arange(len(units)), [len(unit) for unit in units]),
        )
        among = self.columns[columns][:, columns]
        length = np.sqrt(np.maximum(np.diag(among), 0.0))
        one, other = np.nonzero(np.abs(among) > APART * np.outer(length, length))
        joined = np.eye(len(units), dtype=bool)
        joined[of[one], of[other]] = True
        return _connected(joined)

    def price(self, terms: tuple[int, ...]) -> float:
        """Residual sum of squares with `terms` fitted, minus that without them, plus the price of the columns."""
        picked = list(terms)
        if len(picked) == 1:
            (j,) = picked
            return PER_COLUMN - float(self.outputs[j]) ** 2 / max(float(self.columns[j, j]), np.finfo(float).tiny)
        gram, dot = self.columns[picked][:, picked], self.outputs[picked]
        length = np.sqrt(np.maximum(np.diag(gram), np.finfo(float).tiny))
        weights = np.linalg.lstsq(gram / np.outer(length, length), dot / length, rcond=_RCOND)[0]
        return float(-weights @ (dot / length)) + PER_COLUMN * len(terms)

    def prices(self, sets: Sequence[tuple[int, ...]]) -> FloatArray:
        """(U,) prices of each of several sets of terms; infinite where a sign is impossible."""
        out, size = np.empty(len(sets)), np.array([len(terms) for terms in sets], np.int64)
        for width in set(size.tolist()):
            same = np.flatnonzero(size == width)
            picked = np.array([sets[u] for u in same.tolist()], np.int64)
            dot = self.outputs[picked]
            if width == 1:
                out[same] = self._prices_alone(picked[:, 0])
                continue
            gram = self.columns[picked[:, :, None], picked[:, None, :]]
            length = np.sqrt(np.maximum(np.einsum("ujj->uj", gram), np.finfo(float).tiny))
            values, vectors = np.linalg.eigh(gram / (length[:, :, None] * length[:, None, :]))
            kept = values > _RCOND * values[:, -1:]
            inverse = np.where(kept, 1.0 / np.where(kept, values, 1.0), 0.0)
            along = np.einsum("ujk,uj->uk", vectors, dot / length)
            out[same] = PER_COLUMN * width - np.einsum("uk,uk->u", inverse, along**2)
            if self.signs is not None and np.any(self.signs[picked]):
                value = np.einsum("ujk,uk->uj", vectors, inverse * along)
                stderr = np.sqrt(np.einsum("ujk,uk->uj", vectors**2, inverse))
                out[same[np.any(self.signs[picked] * value < -SURE * stderr, axis=1)]] = np.inf
        return out

    def _prices_alone(self, picked: IntArray) -> FloatArray:
        """(U,) `prices` of single candidates: half of all are these."""
        gram = self.columns[picked, picked]
        length = np.sqrt(np.maximum(gram, np.finfo(float).tiny))
        unit, along = gram / (length * length), self.outputs[picked] / length
        inverse = np.divide(1.0, unit, out=np.zeros_like(unit), where=unit > 0.0)
        out = PER_COLUMN - inverse * along**2
        if self.signs is not None:
            out[self.signs[picked] * (inverse * along) < -SURE * np.sqrt(inverse)] = np.inf
        return np.asarray(out)


def _connected(joined: BoolArray) -> IntArray:
    """(U,) number of each unit's part, from (U, U) who is joined to whom. Few units: scipy's graphs take ten times as
    long to be made.
    """
    part = np.arange(len(joined))
    while True:
        least = np.min(np.where(joined, part, len(joined)), axis=1)
        if np.array_equal(least, part):
            return np.asarray((np.cumsum(part == np.arange(len(part))) - 1)[part], np.int64)
        part = least


Asking = Generator[Sequence[tuple[int, ...]], FloatArray, Path]
"""Asks for prices of sets of terms, and is a path at the end."""


def _paths(products: Products, names: Sequence[tuple[Sequence[tuple[int, ...]], bool]]) -> list[Path]:
    """`_path` of each of several names, by their units and whether these are values of one constant.

    All go on side by side, so that prices are computed for all of them at once.
    """
    out = [Path() for _ in names]
    going = {k: _path(products, units, searched=searched) for k, (units, searched) in enumerate(names)}
    asked = {k: next(path) for k, path in going.items()}
    while asked:
        prices = products.prices([terms for sets in asked.values() for terms in sets])
        ends = np.cumsum([len(sets) for sets in asked.values()])
        answers = dict(zip(asked, np.split(prices, ends[:-1]), strict=True))
        asked = {}
        for k, answer in answers.items():
            try:
                asked[k] = going[k].send(answer)
            except StopIteration as end:
                out[k] = end.value
    return out


def _path(products: Products, units: Sequence[tuple[int, ...]], *, searched: bool) -> Asking:
    """Price of the best unit, of the best two, and so on, added one by one while the price falls."""
    path = Path()
    prices = (yield units).copy()
    if searched:
        least = float(np.min(prices))
        best = ties.lowest(prices)
        return {tuple(sorted(units[best])): float(prices[best]) + PER_COLUMN} if least < np.inf else path
    part = products.parts(units)
    taken: tuple[int, ...] = ()
    of_part: dict[int, tuple[tuple[int, ...], float]] = {}
    price, total = np.inf, 0.0
    while total + (least := float(np.min(prices))) < price:
        best = ties.lowest(prices, 1.0 + 1e-3 * abs(total))
        own, paid = of_part.get(int(part[best]), ((), 0.0))
        of_part[int(part[best])] = own, paid = (*own, *units[best]), paid + float(prices[best])
        price = total = total + float(prices[best])
        taken = (*taken, *units[best])
        path[tuple(sorted(taken))] = price
        prices[best] = np.inf
        again = [u for u, unit in enumerate(units) if part[u] == part[best] and unit[0] not in taken]
        if again:
            prices[again] = (yield [(*own, *units[u]) for u in again]) - paid
    return path


def _smallest(path: Path, best: float) -> tuple[tuple[int, ...], float]:
    """The fewest terms of one cause within `DELTA` of the best explanation; otherwise its cheapest."""
    for terms, price in path.items():
        if price - best <= DELTA:
            return terms, price
    every = list(path.items())
    return every[ties.lowest([price for _, price in every])]
