"""Contribution that another explanation may have beside the confirmed one.

Two causes of one class look like one cause in the first run. The further run excludes each of them alone, but a part of
what was found may still be the other cause, and then the size of the confirmed one is wrong by as much.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rig.fitter import ties
from rig.fitter.arrays import FloatArray
from rig.fitter.confirm.compare import Comparison
from rig.fitter.confirm.question import Hypothesis
from rig.fitter.confirm.together import Candidates, Fit, Together, solve
from rig.fitter.quantiles import t_limit

NOTABLE = 1.0 / 3.0
"""Upper limits of shares below this are not mentioned."""


@dataclass(frozen=True)
class MinorCause:
    """A cause that may be there beside the confirmed one.

    Attributes:
        effect: its name.
        up_to: upper 95 % limit of its share of what was found in the first run; at most one.
    """

    effect: str
    up_to: float


def minor_causes(comparison: Comparison, holder: int) -> tuple[MinorCause, ...]:
    """Other members of a question with a notable limit, fitted beside the one that holds, by both runs together."""
    return tuple(ties.ordered(_notable(comparison, holder), key=lambda one: -one.up_to))


def _notable(comparison: Comparison, holder: int) -> Iterator[MinorCause]:
    both, members, model = comparison.both, comparison.question.members, comparison.models[holder]
    first = np.tile(~both.fresh, len(both.sensors))
    own = comparison.own[holder]
    found = float(np.linalg.norm(own[first] @ solve(model, both.outputs)[: own.shape[1]]))
    for member, columns in zip(members, comparison.own, strict=True):
        if member.near or not found or any(term is mine for term in member.terms for mine in members[holder].terms):
            continue
        share = _upper(columns, model, both.outputs, first, t_limit(0.95, both.df)) / found
        if share > NOTABLE:
            yield MinorCause(member.effect, min(share, 1.0))


def notable(first: Together, member: Hypothesis, rest: Candidates, sizes: FloatArray) -> FloatArray:
    """(q, k) sizes of several causes and of other effects, with a notable share of the last cause.

    Runs that were made may not tell a second cause from none: a further run is planned for the least share that is
    mentioned. The sizes of the others are fitted again beside it.

    Args:
        first: runs that were made.
        member: several causes.
        rest: other effects.
        sizes: (q, k) sizes by these runs.
    """
    columns, q = first.columns_of([*member.terms, *rest]), len(member.terms)
    last = np.zeros(columns.shape[1], np.bool_)
    last[q - len(member.last) : q] = True
    found = columns[:, : q - len(member.last)] @ solve(columns[:, ~last], first.outputs)[: q - len(member.last)]
    part = columns[:, last] @ sizes[last]
    length = np.linalg.norm(part, axis=0)
    more = np.maximum(NOTABLE * np.linalg.norm(found) / np.where(length > 0.0, length, np.inf), 1.0) - 1.0
    sizes = sizes.copy()
    sizes[last] *= 1.0 + more
    sizes[~last] -= Fit.of(columns[:, ~last], part * more).estimate
    return sizes


def _upper(columns: FloatArray, model: FloatArray, outputs: FloatArray, first: NDArray[np.bool_], t: float) -> float:
    """Upper limit of the length of the contribution of (n, q) columns to the first run, beside a model."""
    every, q = np.column_stack([columns, model]), columns.shape[1]
    length = np.linalg.norm(every, axis=0)
    every = every / np.where(length > 0.0, length, 1.0)
    inverse = np.linalg.pinv(every, rcond=1e-10)
    part = every[first][:, :q] @ (inverse @ outputs)[:q]
    size = float(np.linalg.norm(part))
    spread = every[first][:, :q] @ inverse[:q]
    along = part @ spread / size if size else np.zeros(len(outputs))
    return size + t * float(np.linalg.norm(along))
