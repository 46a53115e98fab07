"""Forward and backward search: add the best candidate, refit all, drop insignificant ones, until none is
significant.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol, TypeVar, runtime_checkable

from rig.fitter import ties
from rig.fitter.effects.history import nats
from rig.fitter.trace.aliases import Named, Rival, simplest
from rig.fitter.trace.chance import ALPHA
from rig.fitter.trace.doubts import by_the_history

MOST = 16
"""Maximum number of terms: beyond it the declared model is not a model of these data."""
ROUNDS = 3


class Searched(Protocol):
    """Requirements of a search on a run, for any strata. Candidates are known by index."""

    def unit(self, j: int) -> tuple[int, ...]:
        """Candidates that enter and leave together, `j` among them: sine and cosine of one frequency."""

    def best(self, chosen: tuple[int, ...]) -> tuple[int, ...]:
        """The unit that reduces the residual most beside those `chosen`, among the significant ones; empty if there are
        none.
        """

    def p_adjusted(self, chosen: tuple[int, ...], j: int) -> float:
        """Probability that the best of the family looks as good as `j`'s unit beside the other `chosen` by chance."""

    def refined(self: S, chosen: tuple[int, ...]) -> S:
        """The judge with refined values of the searched constants of `chosen`."""


@runtime_checkable
class Bounds(Protocol):
    """A judge that is done sooner where a level is all that counts."""

    def p_up_to(self, chosen: tuple[int, ...], j: int, most: float) -> float:
        """`p_adjusted`; whether it is above `most` is all that need be known."""


class Judge(Searched, Protocol):
    """Requirements for naming the findings of a search."""

    @property
    def candidates(self) -> Sequence[Named]:
        """All candidates, in catalogue order."""

    def rivals(self, chosen: tuple[int, ...], effect: str) -> tuple[Rival, ...]:
        """All explanations for the terms of `effect` among `chosen`, best first."""

    def alike(self, chosen: tuple[int, ...], effect: str) -> tuple[Rival, ...]:
        """The same without some that are not aliases, which takes less time."""


S = TypeVar("S", bound=Searched)
J = TypeVar("J", bound=Judge)


def search(judge: S, start: tuple[int, ...] = ()) -> tuple[S, tuple[int, ...]]:
    """Indices of the candidates that belong in the model, in the order found, starting with `start`."""
    chosen, seen = start, {frozenset(start)}
    while len(chosen) < MOST:
        best = judge.best(chosen)
        if not best:
            break
        judge = judge.refined((*chosen, *best))
        now = prune(judge, (*chosen, *best))
        if frozenset(now) in seen:
            break  # the last model stays: which rows are isolated depends on it, and a gross error could hide it again
        chosen = now
        seen.add(frozenset(chosen))
    return judge, chosen


def prune(judge: Searched, chosen: tuple[int, ...], level: float = ALPHA) -> tuple[int, ...]:
    """`chosen` without the units whose p beside the others is above a level, the weakest dropped first."""
    while chosen:
        units = list(dict.fromkeys(tuple(k for k in judge.unit(j) if k in chosen) for j in chosen))
        weak = [unit for unit in units if not _significant(judge, chosen, unit[0], level)]
        if not weak:
            break
        out = 0 if len(weak) == 1 else ties.highest([judge.p_adjusted(chosen, unit[0]) for unit in weak])
        chosen = tuple(j for j in chosen if j not in weak[out])
    return chosen


def _significant(judge: Searched, chosen: tuple[int, ...], j: int, level: float) -> bool:
    p = judge.p_up_to(chosen, j, level) if isinstance(judge, Bounds) else judge.p_adjusted(chosen, j)
    return p <= level


def search_and_name(
    judge: J, chosen: tuple[int, ...] = (), lead: Callable[[Sequence[Rival]], Rival] = simplest
) -> tuple[J, tuple[int, ...]]:
    """Search, then replace each finding by the `lead` of its alias class, until there is no change.

    The lead, by default the simplest, must be significant by itself too. A laboratory's history may lead to another.
    """
    for _ in range(ROUNDS):
        judge, chosen = search(judge, chosen)
        settled = chosen
        for name in names_of(judge.candidates, chosen):
            if name in names_of(judge.candidates, settled):
                first = by_history(judge.candidates, alike := judge.alike(settled, name), lead(alike))
                others = tuple(j for j in settled if judge.candidates[j].effect.name != name)
                named = (*others, *first.terms)
                if all(_significant(judge, named, j, ALPHA) for j in first.terms):
                    settled = named
        if frozenset(settled) == frozenset(chosen):
            break
        chosen = settled
    return judge, chosen


def by_history(candidates: Sequence[Named], found: Sequence[Rival], first: Rival) -> Rival:
    """The most probable explanation by data and history, where the laboratory found it more often than the `first`.

    `sigmas` squared are twice the logarithm of a likelihood ratio, with the price of columns.
    """
    prior = {rival: nats(candidates[rival.terms[0]].effect) for rival in found if rival.alias}
    oftener = [rival for rival, own in prior.items() if own > prior.get(first, own)]
    return ties.least([first, *oftener], key=lambda rival: rival.sigmas**2 - 2.0 * prior.get(rival, 0.0), unit=1.0)


def led_by_history(
    judge: Judge, chosen: tuple[int, ...], lead: Callable[[Sequence[Rival]], Rival] = simplest
) -> dict[str, str]:
    """Sentences about names that the data alone would not lead to, by name."""
    out = {}
    for name in names_of(judge.candidates, chosen) if any(c.effect.history for c in judge.candidates) else ():
        alike = judge.alike(chosen, name)
        first = lead(alike)
        if first.effect != name and by_history(judge.candidates, alike, first).effect == name:
            own = next(rival for rival in alike if rival.effect == name)
            out[name] = by_the_history(*(judge.candidates[one.terms[0]].effect for one in (own, first)))
    return out


def names_of(candidates: Sequence[Named], chosen: tuple[int, ...]) -> list[str]:
    """Effects of the `chosen` candidates, each once, in order."""
    return list(dict.fromkeys(candidates[j].effect.name for j in chosen))
