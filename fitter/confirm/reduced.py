"""Runs with fewer rows: a triangular factor takes the place of the first run.

A forecast fits many simulated later runs together with the same first run, which may have thousands of observations.
Least squares depends on the first run only by the sums of squares and products of its weighted columns, and a
triangular factor has the same ones.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from rig.fitter.arrays import FloatArray
from rig.fitter.confirm.question import Question
from rig.fitter.confirm.together import Candidates, Own, Together


@dataclass(frozen=True, eq=False)
class Reduced(Together):
    """Both runs, with c rows instead of the first one's; valid for some terms of effects.

    Rows of the first run have the weight one, and no groups with own errors: these are in their values.

    Attributes:
        whole: both runs with all observations.
        terms: of effects.
        columns: (S, N, q) their unweighted columns.
        measured: (S, N) outputs.
        models: (N, d) columns of the declared model for each sensor.
        errors: (S, N) standard deviation of a reading.
        groups: own errors of replications or whole plots of the later run, for each sensor.
    """

    whole: Together
    terms: Candidates
    columns: FloatArray
    measured: FloatArray
    models: tuple[FloatArray, ...]
    errors: FloatArray
    groups: tuple[tuple[Own, ...], ...]

    @classmethod
    def of(cls, whole: Together, questions: Sequence[Question]) -> Together:
        """These runs reduced to the terms of some questions; as it was if its first run is short."""
        terms = _different(questions)
        fresh, raw = whole.fresh, whole.untouched(terms)
        old = [np.column_stack([own, raw[i], whole.raw_outputs[i]])[~fresh] for i, own in enumerate(whole.declared)]
        count = max(columns.shape[1] for columns in old)
        if np.sum(~fresh) <= 2 * count:
            return whole
        first = whole.only(~fresh)
        factors = []
        for i, columns in enumerate(old):
            triangle = np.linalg.qr(first.weigh(i, columns), mode="r")
            factors.append(np.pad(triangle, ((0, count - len(triangle)), (0, 0))))
        widths = [own.shape[1] for own in whole.declared]
        effects = np.stack([factor[:, d:-1] for factor, d in zip(factors, widths, strict=True)])
        outputs = np.stack([factor[:, -1] for factor in factors])
        models = (np.vstack([f[:, :d], own[fresh]]) for f, d, own in zip(factors, widths, whole.declared, strict=True))
        shift = count - int(np.sum(~fresh))
        return cls(
            np.concatenate([np.zeros(count, np.int64), whole.run[fresh]]),
            whole,
            terms,
            np.concatenate([effects, raw[:, fresh]], axis=1),
            np.concatenate([outputs, whole.raw_outputs[:, fresh]], axis=1),
            tuple(models),
            np.concatenate([np.ones_like(outputs), whole.sigma[:, fresh]], axis=1),
            tuple(tuple(_moved(own, shift) for own in groups if fresh[own.rows[0]]) for groups in whole.own),
            done=tuple(one.at(fresh).among(count, count + int(fresh.sum())) for one in whole.done),
        )

    @property
    def data(self) -> object:
        """Observations of both runs, with all of the first one."""
        return self.whole.data

    @property
    def df(self) -> int:
        """Degrees of freedom of the error's estimate."""
        return self.whole.df

    @property
    def realigned(self) -> bool:
        """Whether the first run does not determine the declared model's parameters in the later one."""
        return self.whole.realigned

    @property
    def predicted(self) -> NDArray[np.bool_]:
        """(n,) observations of later runs with the parameters of the first one."""
        later = self.whole.predicted[self.whole.fresh]
        return np.concatenate([np.zeros(self.run.size - later.size, np.bool_), later])

    @property
    def own_response(self) -> bool:
        """Whether sensors that nobody moved may have another response in the later run."""
        return self.whole.own_response

    @property
    def loose(self) -> FloatArray:
        """(n, l) the later run's own parameters, estimated for its prediction: a zero or an alignment, or none."""
        later = self.whole.loose[self.whole.fresh]
        return np.vstack([np.zeros((self.fresh.size - len(later), later.shape[1])), later])

    @property
    def raw_outputs(self) -> FloatArray:
        """(S, n) measured outputs."""
        return self.measured

    @property
    def sigma(self) -> FloatArray:
        """(S, n) standard deviation of a reading."""
        return self.errors

    @property
    def slope(self) -> FloatArray:
        """(S,) output per unit of the inferred quantity: V/g, or mV/psi."""
        return self.whole.slope

    @property
    def declared(self) -> tuple[FloatArray, ...]:
        """(n, d) columns of the declared model, for each sensor."""
        return self.models

    @property
    def own(self) -> tuple[tuple[Own, ...], ...]:
        """Own errors of replications or whole plots, for each sensor; those of the later run only."""
        return self.groups

    @cached_property
    def own_df(self) -> tuple[int, ...]:
        """Degrees of freedom of the variance of own errors in the first run, for each sensor; 0 without any."""
        return self.whole.own_df

    def untouched(self, terms: Candidates) -> FloatArray:
        """(S, n, q) unweighted columns of effects as if nobody changed the bench, zero for sensors without the term.
        Raises `KeyError` for terms of no question.
        """
        return self.columns[:, :, [self._number[id(term)] for term in terms]]

    def only(self, rows: NDArray[np.bool_]) -> Self:
        """These runs with some of the observations only."""
        position = np.cumsum(rows) - 1
        return replace(
            self,
            run=self.run[rows],
            columns=self.columns[:, rows],
            measured=self.measured[:, rows],
            models=tuple(own[rows] for own in self.models),
            errors=self.errors[:, rows],
            groups=tuple(
                tuple(replace(own, rows=position[own.rows]) for own in groups if rows[own.rows].all())
                for groups in self.groups
            ),
            done=tuple(one.at(rows) for one in self.done),
        )

    @cached_property
    def _number(self) -> dict[int, int]:
        return {id(term): number for number, term in enumerate(self.terms)}


def reduced(ways: Sequence[Together], questions: Sequence[Question]) -> Iterator[tuple[list[Together], Question]]:
    """For every question: both runs in each course with fewer rows, and the question, about the sensors with a part in
    it.

    Args:
        ways: the first run and a planned one.
        questions: open questions.
    """
    common: list[Together] = []
    for question in questions:
        about = [both.about(question) for both in ways]
        if all(own is both for both, (own, _) in zip(ways, about, strict=True)):
            common = common or [Reduced.of(both, questions) for both in ways]
            yield common, question
        else:
            yield [Reduced.of(own, [alone]) for own, alone in about], about[0][1]


def _different(questions: Sequence[Question]) -> Candidates:
    """All terms of some questions, each once."""
    members = (term for question in questions for member in question.members for term in member.terms)
    rest = (term for question in questions for term in question.rest)
    return tuple({id(term): term for term in (*members, *rest)}.values())


def _moved(own: Own, rows: int) -> Own:
    return replace(own, rows=own.rows + rows)
