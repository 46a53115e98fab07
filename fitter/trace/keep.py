"""What stays of what was found, by one rule in every kind of run.

An effect stays only if, refitted with all others at the end, it is significant and lowers the error that is declared.
What is not kept is named, with the reason.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from fitter.trace.chance import ALPHA
from fitter.trace.not_kept import NotKept
from fitter.trace.search import Judge, prune

Groups = dict[tuple[str, str | None], tuple[int, ...]]


def groups_of(judge: Judge, chosen: Iterable[int]) -> Groups:
    """The `chosen` candidates by effect and sensor: what is kept, or not, together."""
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
    """Those of the `chosen` candidates that stay, and the others that stood out but do not help.

    Args:
        judge: that ended the search.
        chosen: candidates found.
        helps: whether the declared error is smaller with some of the chosen (the second argument) than without them.
        error: what that error is, in words.
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
