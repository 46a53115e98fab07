"""Choice of points that separate rival models: T-optimality (Atkinson and Fedorov, Biometrika 62, 1975).

A design separates a true model from a rival by the least squared distance between the true model's prediction and the
rival's best fit to it. Here both models have the first run too, and the distance is that of both runs, in units of the
error: it is the expected difference between the judge's residual sums of squares. With several pairs of models the
least distance counts (maximin), softened so that an exchange of points has a direction.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import special

from rig.fitter import ties
from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.confirm.compare import NOTHING, Pair, costs_so_far, fitted_again, possible
from rig.fitter.confirm.minor_causes import notable
from rig.fitter.confirm.question import Question
from rig.fitter.confirm.reduced import reduced
from rig.fitter.confirm.together import Candidates, Fit, Together

UNSEEN = 2.0
"""Distance, in standard errors, below which the largest run does not separate a pair: it has no influence."""
LITTLE = 1e-9
"""Weight of a prior that makes undetermined coefficients of a rival computable."""
AT_ONCE = 0.2
"""Largest share of the points that is removed together."""
EXCHANGES = 8
KEPT = 3
"""Number of choices whose fits a rival keeps: one, that without a unit, and that with another in its place."""
SHORT = 0.8
"""Share of a required distance that exchanges can make up for."""


@dataclass(frozen=True, eq=False)
class Rival:
    """A model that could be fitted instead of true ones; U candidate units of points with m rows each.

    Attributes:
        pairs: for each true model, the names of both; of the absence of a cause "nothing".
        first: (p, p) products of its columns in the first run, with priors.
        later: (U, m, p) its columns in each unit, in units of the error; zero rows fill up.
        true_first: (T, p + 1) products of its columns and of T true predictions with these, in the first run; the last
            column has the squares.
        true_later: (T, U, m) true predictions in each unit.
    """

    pairs: tuple[Pair, ...]
    first: FloatArray
    later: FloatArray
    true_first: FloatArray
    true_later: FloatArray

    def squares(self, chosen: NDArray[np.bool_]) -> FloatArray:
        """(T,) squared distances of the refitted rival from true predictions."""
        return self.refitted(chosen)[2]

    def refitted(self, chosen: NDArray[np.bool_]) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(p, p) inverse, (T, p) coefficients of the rival fitted to true predictions, (T,) squared distances.

        The last ones are kept: a choice is asked for its distances, and then for what its units change.
        """
        key = chosen.tobytes()
        if key not in self._refitted:
            while len(self._refitted) >= KEPT:
                self._refitted.pop(next(iter(self._refitted)))
            self._refitted[key] = self._refit(chosen)
        return self._refitted[key]

    def _refit(self, chosen: NDArray[np.bool_]) -> tuple[FloatArray, FloatArray, FloatArray]:
        z, f = self.later[chosen], self.true_later[:, chosen]
        flat = z.reshape(-1, z.shape[2])
        inverse = np.linalg.inv(self.first + flat.T @ flat)
        cross = self.true_first[:, :-1] + f.reshape(len(f), -1) @ flat
        weights = cross @ inverse
        square = self.true_first[:, -1] + np.sum(f**2, axis=(1, 2)) - np.sum(weights * cross, axis=1)
        return np.asarray(inverse, np.float64), weights, np.asarray(np.maximum(square, 0.0))

    @cached_property
    def _refitted(self) -> dict[bytes, tuple[FloatArray, FloatArray, FloatArray]]:
        return {}

    def left(self, weights: FloatArray, units: IntArray) -> FloatArray:
        """(T, u, m) what the rival with coefficients (T, p) leaves of true predictions in some units."""
        predicted = self.later[units] @ weights.T
        return np.asarray(self.true_later[:, units] - predicted.transpose(2, 0, 1))

    def changes(self, chosen: NDArray[np.bool_], units: IntArray) -> tuple[FloatArray, FloatArray]:
        """(T, u) change of the squared distances by adding one of these units, or removing it if chosen; (T,) these."""
        inverse, weights, square = self.refitted(chosen)
        later, left = self.later[units], self.left(weights, units)
        hat = (later @ inverse) @ later.transpose(0, 2, 1)
        sign = np.where(chosen[units], -1.0, 1.0)
        inner = np.eye(hat.shape[1]) + sign[:, None, None] * hat
        inner += LITTLE * np.eye(hat.shape[1])
        solved = np.linalg.solve(inner, left.transpose(1, 2, 0))
        return sign * np.einsum("tum,umt->tu", left, solved), square


@dataclass(frozen=True, eq=False)
class Choice:
    """Chosen units for a number of them.

    Attributes:
        points: the candidates.
        chosen: (U,) whether a unit is chosen.
    """

    points: Points
    chosen: NDArray[np.bool_]

    @property
    def units(self) -> tuple[int, ...]:
        """Their labels, ascending."""
        return tuple(np.flatnonzero(self.chosen).tolist())

    @cached_property
    def sigmas(self) -> float:
        """Standard errors of the pair with the least distance."""
        return float(self.points.sigmas(self.chosen).min())

    @cached_property
    def better(self) -> Choice:
        """As many units, exchanged one after the other for better ones."""
        return Choice(self.points, self.points.exchanged(self.chosen))


@dataclass(frozen=True, eq=False)
class Points:
    """Candidate units of a planned run, such as points of a design or whole plots.

    Attributes:
        rivals: of all questions and courses of the run.
        count: number of units U.
        reach: root of the size of the largest possible run over that of all candidates.
    """

    rivals: tuple[Rival, ...]
    count: int
    reach: float

    @classmethod
    def of(cls, ways: Sequence[Together], questions: Sequence[Question], units: IntArray, most: int) -> Points:
        """The first run and a planned one with all candidates, in its possible courses.

        Args:
            ways: both runs; outputs of the planned one are not used.
            questions: open questions.
            units: (n,) label of each planned observation's unit, from 0.
            most: number of observations of the largest possible run.
        """
        about = reduced(ways, questions)
        found = [rival for own, question in about for both in own for rival in _rivals(both, question, units)]
        return cls(tuple(found), int(units.max()) + 1, float(np.sqrt(max(most / units.size, 1.0))))

    @property
    def pairs(self) -> frozenset[Pair]:
        """Pairs that a run of some size may separate, as `Separation.chances` has them."""
        every = [pair for rival in self.rivals for pair in rival.pairs]
        return frozenset(pair for pair, seen in zip(every, self._seen, strict=True) if seen)

    def sigmas(self, chosen: NDArray[np.bool_]) -> FloatArray:
        """Distance of every pair that the candidates can separate, standard errors."""
        squares = np.concatenate([rival.squares(chosen) for rival in self.rivals]) if self.rivals else np.empty(0)
        return np.asarray(np.sqrt(squares[self._seen]))

    @cached_property
    def _seen(self) -> NDArray[np.bool_]:
        every = np.ones(self.count, np.bool_)
        squares = np.concatenate([rival.squares(every) for rival in self.rivals]) if self.rivals else np.empty(0)
        return np.asarray(squares > (UNSEEN / self.reach) ** 2)

    def choose(self, counts: Sequence[int], least: float) -> list[Choice]:
        """Good units for each number of them, from few to many, by elimination from all.

        Args:
            counts: numbers of units.
            least: distance in standard errors that a choice should have; none is far below it.
        """
        if not self._seen.any():
            return []
        chosen, left = np.ones(self.count, np.bool_), []
        for count in sorted((c for c in counts if c < self.count), reverse=True):
            while chosen.sum() > count:
                units = np.flatnonzero(chosen)
                some = max(1, min(units.size - count, int(AT_ONCE * units.size)))
                chosen[units[ties.descending(-self._worth(chosen, units))[:some]]] = False
            left.append(Choice(self, chosen.copy()))
            if left[-1].sigmas < SHORT * least:
                left.pop()
                break
        return left[::-1]

    def exchanged(self, chosen: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """One unit after the other replaced by a better one, until none is."""
        for _ in range(EXCHANGES):
            units = np.flatnonzero(chosen)
            worst = int(units[ties.lowest(self._worth(chosen, units))])
            without = chosen.copy()
            without[worst] = False
            others = np.flatnonzero(~without)
            best = int(others[ties.highest(self._worth(without, others))])
            if best == worst:
                return chosen
            without[best] = True
            if not ties.below(self._soft(chosen), self._soft(without)):
                return chosen
            chosen = without
        return chosen

    def _soft(self, chosen: NDArray[np.bool_]) -> float:
        squares = self.sigmas(chosen) ** 2
        return float(-special.logsumexp(-0.5 * squares))

    def _worth(self, chosen: NDArray[np.bool_], units: IntArray) -> FloatArray:
        """(u,) gain of the objective by adding one of these units, or its loss by removing it."""
        told = [rival.changes(chosen, units) for rival in self.rivals]
        change = np.concatenate([change for change, _ in told])[self._seen]
        square = np.concatenate([square for _, square in told])[self._seen]
        heat = max(1.0, float(square.min()) / 20.0)
        now = special.logsumexp(-0.5 * square / heat)
        then = special.logsumexp(-0.5 * (square[:, None] + change) / heat, axis=0)
        return np.asarray(np.abs(now - then))


def _rivals(both: Together, question: Question, units: IntArray) -> list[Rival]:
    """Every member as a rival of the others that are possible, and the absence of one of these in the later run as its
    rival.
    """
    first = both.only(~both.last)
    scale, true = [both.raw(member.terms) for member in question.members], {}
    for j in possible(costs_so_far(first, question), question, both.df):
        member = question.members[j]
        known = Fit.of(first.columns_of([*member.terms, *question.rest]), first.outputs).estimate
        if member.last:
            known = notable(first, member, question.rest, known[:, None])[:, 0]
        true[j] = scale[j] @ known[: len(member.terms)]
    rest = _with_resized(both, question.rest)
    found, names = [], [member.effect for member in question.members]
    for j, member in enumerate(question.members):
        own = _with_resized(both, member.terms)
        others = [i for i in true if i != j]
        if others:
            pairs = tuple((names[min(i, j)], names[max(i, j)]) for i in others)
            effects = np.concatenate([own, rest], axis=2)
            found.append(_rival(both, question, effects, pairs, [true[i] for i in others], units))
        if j in true:
            gone = np.concatenate([scale[j] * ~both.fresh[:, None], rest], axis=2)
            found.append(_rival(both, question, gone, ((names[j], NOTHING),), [true[j]], units))
    return found


def _with_resized(both: Together, terms: Candidates) -> FloatArray:
    return np.concatenate([both.raw(terms), both.resized(terms).raw], axis=2)


def _rival(
    both: Together,
    question: Question,
    effects: FloatArray,
    pairs: tuple[Pair, ...],
    true: Sequence[FloatArray],
    units: IntArray,
) -> Rival:
    """A rival with effects (S, n, q), against true predictions (S, n)."""
    blocks, priors = _declared(both, again=fitted_again(both, question))
    z = np.concatenate([*blocks, effects, np.stack(true, axis=2)], axis=2)
    prior = np.concatenate([priors, np.zeros(effects.shape[2] + len(true))])
    rows = np.stack(
        [np.where(both.last[:, None], x / both.sigma[i][:, None], both.weigh(i, x)) for i, x in enumerate(z)]
    )
    p = z.shape[2] - len(true)
    old = rows[:, ~both.last].reshape(-1, z.shape[2])
    new = rows[:, both.last]
    length = np.sqrt(np.sum(rows[..., :p] ** 2, axis=(0, 1)))
    length = np.where(prior[:p] > 0, 1.0, np.where(length > 0, length, 1.0))
    old[:, :p] /= length
    new[..., :p] /= length
    products = old.T @ old
    by_unit = np.argsort(units, kind="stable")
    at = units[by_unit]
    within = np.arange(at.size) - np.searchsorted(at, at)
    filled = np.zeros((int(units.max()) + 1, len(rows), int(within.max()) + 1, z.shape[2]))
    filled[at, :, within] = new[:, by_unit].transpose(1, 0, 2)
    candidates = filled.reshape(len(filled), -1, z.shape[2])
    told = np.column_stack([products[p:, :p], np.diag(products)[p:]])
    start = products[:p, :p] + np.diag(prior[:p] + LITTLE)
    return Rival(pairs, start, candidates[..., :p], told, np.moveaxis(candidates[..., p:], 2, 0))


def _declared(both: Together, *, again: bool) -> tuple[list[FloatArray], FloatArray]:
    """Columns (S, n, d) of the declared model of every sensor, its copies in later runs, and own errors of groups.

    With the precision of the prior of each column: one for own errors, in units of the error.
    """
    count, n = len(both.sensors), both.fresh.size
    blocks, priors = [], []
    for i, own in enumerate(both.declared):
        later = [both.predicted & (both.run == k) for k in range(1, int(both.run.max()) + 1)] if again else []
        for columns in (own, *(own * rows[:, None] for rows in later)):
            block = np.zeros((count, n, columns.shape[1]))
            block[i] = columns
            blocks.append(block)
            priors.append(np.zeros(columns.shape[1]))
        for group in both.own[i]:
            if both.last[group.rows[0]] and np.any(group.kept < 1.0):
                block = np.zeros((count, n, group.kept.size))
                strength = np.sqrt(np.maximum(group.kept**-2.0 - 1.0, 0.0))
                block[i, group.rows] = group.basis * strength * both.sigma[i][group.rows, None]
                blocks.append(block)
                priors.append(np.ones(group.kept.size))
    return blocks, np.concatenate(priors)
