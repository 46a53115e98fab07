"""What a run would tell before it is made: how far the explanations of an effect would fall apart."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fitter.arrays import FloatArray
from fitter.confirm.judge import PARTED, nuisance
from fitter.confirm.question import Question
from fitter.confirm.together import Candidates, Together, left, solve
from fitter.quantiles import t_limit

NOTHING = "nothing"


@dataclass(frozen=True)
class Separation:
    """Of the explanations of one effect.

    Attributes:
        effect: the one that was named.
        sigmas: for each pair of members, standard errors by which the one would fall behind if the other were true,
            whichever is less. The member `NOTHING` is that what was found in the first run is not in the later one.

    """

    effect: str
    sigmas: Mapping[tuple[str, str], float]

    @property
    def least(self) -> float:
        """Of the pair that would be nearest."""
        return min(self.sigmas.values())


def separation(both: Together, questions: Sequence[Question]) -> tuple[Separation, ...]:
    """Expected of a planned run, whose outputs do not matter.

    Each member in turn is taken for true, with the size the first run gives it, and every other is fitted to what it
    would do in both runs: the square root of what remains, in units of the error, is how far behind that other falls;
    less where the error is known with few degrees of freedom, so that three always part two explanations.
    """
    first, out, scale = both.only(~both.fresh), [], 3.0 / t_limit(PARTED, both.df)
    for question in questions:
        rest = np.column_stack([both.columns_of(question.rest), nuisance(both, question)])
        columns = [both.columns_of(member.terms) for member in question.members]
        models = [np.column_stack([own, rest]) for own in columns]
        true = [own @ _size(first, m.terms, question.rest) for own, m in zip(columns, question.members, strict=True)]
        gone = [_absent(both, m.terms, _size(first, m.terms, question.rest), rest) for m in question.members]
        pairs = itertools.combinations(range(len(columns)), 2)
        out.append(
            Separation(
                question.effect,
                {
                    (question.members[i].effect, question.members[j].effect): scale
                    * min(_behind(true[i], models[j]), _behind(true[j], models[i]))
                    for i, j in pairs
                }
                | {(m.effect, NOTHING): scale * sigmas for m, sigmas in zip(question.members, gone, strict=True)},
            )
        )
    return tuple(out)


def _size(first: Together, terms: Candidates, rest: Candidates) -> FloatArray:
    """(q,) coefficients of an explanation by the first run."""
    model = np.column_stack([first.columns_of(terms), first.columns_of(rest)])
    return solve(model, first.outputs)[: len(terms)]


def _absent(both: Together, terms: Candidates, size: FloatArray, rest: FloatArray) -> float:
    """Standard errors by which an explanation would be missed in the later run."""
    return _behind(both.columns_in(terms, both.fresh) @ size, rest)


def _behind(true: FloatArray, columns: FloatArray) -> float:
    """Length of what `columns` leave of something true."""
    return float(np.linalg.norm(left(columns, true)))
