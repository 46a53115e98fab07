"""Distances between the explanations of an effect, for given outputs, of one run or of many simulated ones.

The judge passes it measured outputs, the forecast simulated ones.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rig.fitter import ties
from rig.fitter.arrays import FloatArray
from rig.fitter.confirm.question import Hypothesis, Question
from rig.fitter.confirm.together import Fit, Together, left
from rig.fitter.linear import orthonormal
from rig.fitter.quantiles import DISTINGUISHED, t_limit
from rig.fitter.trace.aliases import PER_COLUMN

CARRIED_ON = ("time", "temperature", "interruption", "chamber")
"""Sources of effects that continue from one run to the next."""


NOTHING = "nothing"
"""The absence of an effect of the first run in the later one."""
Pair = tuple[str, str]


@dataclass(frozen=True, eq=False)
class Apart:
    """Statistics of M members, for each of k sets of outputs.

    Attributes:
        costs: (M, k) residual sum of squares of both runs, in units of the error's variance, plus the price of columns
            and searched constants, over the misfit of the best member in the later run.
        shown: (M, k) standard errors by which the later run shows each member; one of time by what it does within that
            run, as anything else may change the level from one day to another.
    """

    costs: FloatArray
    shown: FloatArray

    @property
    def behind(self) -> FloatArray:
        """(M, k) standard errors by which each member is worse than the best."""
        return behind(self.costs)


@dataclass(frozen=True, eq=False)
class Comparison:
    """The members of one question as models of both runs.

    Attributes:
        both: the runs.
        question: the question.
    """

    both: Together
    question: Question

    @cached_property
    def rest(self) -> FloatArray:
        """(S n, r) columns that are fitted with every member: those of other effects, and of the later run's own
        parameters.
        """
        return np.column_stack([self.both.all_columns_of(self.question.rest), nuisance(self.both, self.question)])

    @cached_property
    def own(self) -> tuple[FloatArray, ...]:
        """Columns (S n, q) of each member, with its sizes of the first run."""
        return tuple(self.both.columns_of(member.terms) for member in self.question.members)

    @cached_property
    def resized(self) -> tuple[FloatArray, ...]:
        """Columns (S n, p) of each member for its sizes after changes by a person."""
        return tuple(self.both.resized_columns(member.terms) for member in self.question.members)

    @cached_property
    def models(self) -> tuple[FloatArray, ...]:
        """Columns (S n, q + p + r) of each member, with the common ones."""
        parts = zip(self.own, self.resized, strict=True)
        return tuple(np.column_stack([own, resized, self.rest]) for own, resized in parts)

    def apart(self, outputs: FloatArray) -> Apart:
        """Statistics of outputs (S n, k), weighted and with the declared model removed, as `Together.outputs`."""
        return Apart(self.costs(outputs), np.array([self.shown(j, outputs) for j in range(len(self.own))]))

    def costs(self, outputs: FloatArray) -> FloatArray:
        """(M, k) `Apart.costs` of such outputs (S n, k)."""
        fresh = np.tile(self.both.fresh, len(self.both.sensors))
        costs: list[FloatArray] = []
        misfits = []
        for member, own, basis, df in zip(self.question.members, self.own, self._bases, self._free, strict=True):
            rest = outputs - basis @ (basis.T @ outputs)
            rss, later = np.sum(rest**2, axis=0), np.sum(rest[fresh] ** 2, axis=0)
            costs.append(rss + PER_COLUMN * (own.shape[1] + searched(member)) + self._coincidence(len(costs), outputs))
            misfits.append(later / df if df >= 1.0 else np.ones_like(rss))
        best = ties.highest_of_each(-np.array(costs))
        misfit = np.maximum(np.take_along_axis(np.array(misfits), best[None], 0)[0], 1.0)
        return np.asarray(np.array(costs) / misfit)

    def shown(self, j: int, outputs: FloatArray) -> FloatArray:
        """(k,) `Apart.shown` of a member."""
        gone, within = self._gone[j], self._within[j]
        inside = self._bases[j] if within is None else within
        without, beside = (np.sum((outputs - basis @ (basis.T @ outputs)) ** 2, axis=0) for basis in (gone, inside))
        return np.asarray(np.sqrt(np.maximum(without - beside, 0.0)))

    def _coincidence(self, j: int, outputs: FloatArray) -> FloatArray:
        """(k,) price of a member's sizes after changes by a person.

        A size after a change is independent of the one before, but of the same order: with a normal prior whose
        standard deviation is the size before, the marginal likelihood has the price log(1 + z^2), z being that size
        in standard errors of the size after. So a cause that a change should have resized is less likely if its size
        stayed the same.
        """
        resized = self.resized[j]
        if not resized.shape[1]:
            return np.zeros(outputs.shape[1])
        of = self.both.resized(self.question.members[j].terms).of
        sizes = Fit.of(self.models[j], outputs).estimate
        price, model = np.zeros(outputs.shape[1]), np.column_stack([self.own[j], self.rest])
        for column, term in enumerate(of):
            length = np.linalg.norm(left(model, resized[:, column]))
            price += np.maximum(np.log1p((sizes[term] * length) ** 2), PER_COLUMN)
            model = np.column_stack([model, resized[:, column]])
        return price

    @cached_property
    def _bases(self) -> tuple[FloatArray, ...]:
        return tuple(orthonormal(model) for model in self.models)

    @cached_property
    def _levels(self) -> tuple[FloatArray, ...]:
        """(S n, l) the declared model again in the later run, for members of time."""
        again, none = self.both.again, np.zeros((self.both.outputs.size, 0))
        of_time = (all(t.effect.source == "time" for t in member.terms) for member in self.question.members)
        return tuple(again if one and self.both.own_response else none for one in of_time)

    @cached_property
    def _within(self) -> tuple[FloatArray | None, ...]:
        """Bases of each member with a later run of another level; None where it has that of the first run."""
        pairs = zip(self.models, self._levels, strict=True)
        return tuple(orthonormal(np.column_stack([one, more])) if more.shape[1] else None for one, more in pairs)

    @cached_property
    def _gone(self) -> tuple[FloatArray, ...]:
        """Bases of each member's existence in the first run only."""
        first = ~self.both.fresh
        return tuple(
            orthonormal(np.column_stack([self.both.columns_in(member.terms, first), self.rest, more]))
            for member, more in zip(self.question.members, self._levels, strict=True)
        )

    def expected(self, j: int) -> float:
        """Standard errors by which the later run shows a member that is as large in it as in the first run."""
        first, terms = self.both.only(~self.both.fresh), self.question.members[j].terms
        sizes = Fit.of(first.columns_of([*terms, *self.question.rest]), first.outputs).estimate[: len(terms)]
        there, gone = self.both.columns_in(terms, self.both.fresh) @ sizes, self._gone[j]
        return float(np.linalg.norm(there - gone @ (gone.T @ there)))

    @cached_property
    def _free(self) -> tuple[float, ...]:
        """Degrees of freedom of the later run for each member."""
        fresh = np.tile(self.both.fresh, len(self.both.sensors))
        taken = self.both.leverage(self.both.fresh)
        return tuple(float(fresh.sum() - np.sum(basis[fresh] ** 2) - taken) for basis in self._bases)


def behind(costs: FloatArray) -> FloatArray:
    """(M, k) standard errors by which each of M members is worse than the best, by their costs (M, k)."""
    return np.asarray(np.sqrt(np.maximum(costs - costs.min(0), 0.0)))


def costs_so_far(made: Together, question: Question) -> FloatArray:
    """(M,) residual sums of squares of the members in the runs that were made, with the price of columns."""
    costs = []
    for member in question.members:
        rest = left(made.columns_of([*member.terms, *question.rest]), made.outputs)
        costs.append(float(np.sum(rest**2)) + PER_COLUMN * (len(member.terms) + searched(member)))
    return np.array(costs)


def possible(costs: FloatArray, question: Question, df: float) -> list[int]:
    """Numbers of the members that a forecast takes to be true, by their `costs_so_far`.

    The runs that were made exclude the others: no run is planned to tell two of these apart, nor to show one of them.
    Causes beside another one are never among them.

    Args:
        costs: (M,) of the members.
        question: the question.
        df: degrees of freedom of the error.
    """
    far = behind(costs) > t_limit(DISTINGUISHED, df)
    return [j for j, member in enumerate(question.members) if member.several or not far[j]]


def nuisance(both: Together, question: Question) -> FloatArray:
    """(S n, q) the declared model again in the later run, if it may be another there."""
    return both.again if fitted_again(both, question) else np.zeros((both.outputs.size, 0))


def fitted_again(both: Together, question: Question) -> bool:
    """Whether the declared model is fitted again in the later run: if no member is of time or temperature.

    Then undeclared effects that continue between runs have no influence on causes that do not. A run whose parameters
    the first one does not determine has its own anyway.
    """
    return both.own_response and lasting(question) and bool(np.any(both.predicted))


def lasting(question: Question) -> bool:
    """Whether no member is of time or temperature, which continue from one run to the next."""
    return all(term.effect.source not in CARRIED_ON for member in question.members for term in member.terms)


def searched(member: Hypothesis) -> bool:
    """Whether a constant in its columns was searched, and has a price."""
    return bool(getattr(member.terms[0].effect, "searched", False))
