"""Selection of the effects to keep, by one rule in every kind of run.

An effect is kept only if, refitted with all others at the end, it is significant and reduces the declared error.
Effects that are not kept are named, with the reason.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from fitter.trace.chance import ALPHA
from fitter.trace.not_kept import NotKept
from fitter.trace.search import Judge, prune

Groups = dict[tuple[str, str | None], tuple[int, ...]]


def groups_of(judge: Judge, chosen: Iterable[int]) -> Groups:
    """The `chosen` candidates by effect and sensor, kept or removed together."""
    groups: Groups = {}
    for j in chosen:
        candidate = judge.candidates[j]
        key = candidate.effect.name, candidate.sensor
        groups[key] = (*groups.get(key, ()), j)
    return groups


def kept(
    judge: Judge,
    chosen: tuple[int, ...],
    helps: Callable[[tuple[int, ...], tuple[int, ...]], bool],
    error: str,
    level: float = ALPHA,
) -> tuple[tuple[int, ...], tuple[NotKept, ...]]:
    """The kept ones of the `chosen` candidates, and the significant others that do not help.

    Args:
        judge: the judge at the end of the search.
        chosen: candidates found.
        helps: whether the declared error is smaller with some of the chosen (the second argument) than without them.
        error: name of that error.
        level: largest p that is significant.
    """
    left: list[NotKept] = []
    while chosen := prune(judge, chosen, level):
        idle = {key: own for key, own in groups_of(judge, chosen).items() if not helps(chosen, own)}
        if not idle:
            break
        p = {key: max(judge.p_adjusted(chosen, j) for j in own) for key, own in idle.items()}
        worst = max(p, key=lambda key: p[key])
        left.append(NotKept(*worst, "error", p[worst], error))
        chosen = tuple(j for j in chosen if j not in idle[worst])
    return chosen, tuple(left)
