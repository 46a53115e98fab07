"""Forward and backward search: add the best, refit all, drop what is no longer needed, until nothing stands out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np

from fitter.trace.aliases import Named, Rival, simplest
from fitter.trace.family import ALPHA

MOST = 16
"""Terms after which a search is given up: the declared model is not a model of these data."""
ROUNDS = 3


class Judge(Protocol):
    """What a search asks of a run, whatever its strata are. Candidates are known by index."""

    @property
    def candidates(self) -> Sequence[Named]:
        """All there are, in catalogue order."""

    def best(self, chosen: tuple[int, ...]) -> int | None:
        """The candidate that removes most beside those `chosen`, of those that stand out; None if none does."""

    def p_adjusted(self, chosen: tuple[int, ...], j: int) -> float:
        """Probability that the best of the family looks as good as `j` beside the other `chosen` by chance."""

    def rivals(self, chosen: tuple[int, ...], effect: str) -> tuple[Rival, ...]:
        """All explanations of what the terms of `effect` among `chosen` explain, best first."""


def search(judge: Judge, start: tuple[int, ...] = ()) -> tuple[int, ...]:
    """Indices of the candidates that belong in the model, in the order found, from `start` on."""
    chosen, seen = start, {frozenset(start)}
    while len(chosen) < MOST:
        best = judge.best(chosen)
        if best is None:
            break
        chosen = prune(judge, (*chosen, best))
        if frozenset(chosen) in seen:
            break
        seen.add(frozenset(chosen))
    return chosen


def prune(judge: Judge, chosen: tuple[int, ...]) -> tuple[int, ...]:
    """`chosen` without those that are not significant beside the others, the weakest dropped first."""
    while chosen:
        p = [judge.p_adjusted(chosen, j) for j in chosen]
        weakest = int(np.argmax(p))
        if p[weakest] <= ALPHA:
            break
        chosen = chosen[:weakest] + chosen[weakest + 1 :]
    return chosen


def search_and_name(
    judge: Judge, chosen: tuple[int, ...] = (), lead: Callable[[Sequence[Rival]], Rival] = simplest
) -> tuple[int, ...]:
    """Search, then put the `lead` of each alias class in the place of what was found first, until nothing moves.

    The lead, the simplest if not told otherwise, has to stand out by itself too.
    """
    for _ in range(ROUNDS):
        chosen = search(judge, chosen)
        settled = chosen
        for name in names_of(judge.candidates, chosen):
            if name in names_of(judge.candidates, settled):
                first = lead(judge.rivals(settled, name))
                others = tuple(j for j in settled if judge.candidates[j].effect.name != name)
                named = (*others, *first.terms)
                if all(judge.p_adjusted(named, j) <= ALPHA for j in first.terms):
                    settled = named
        if frozenset(settled) == frozenset(chosen):
            break
        chosen = settled
    return chosen


def names_of(candidates: Sequence[Named], chosen: tuple[int, ...]) -> list[str]:
    """Effects of the `chosen` candidates, each once, in order."""
    return list(dict.fromkeys(candidates[j].effect.name for j in chosen))
