"""Selection of the effects to keep, by one rule in every kind of run.

An effect is kept only if, refitted with all others at the end, it is significant and reduces the declared error. All
kept effects together never raise the error that the trace states. Effects that are not kept are named, with the reason.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np

from rig.fitter import ties
from rig.fitter.arrays import FloatArray
from rig.fitter.trace.chance import ALPHA
from rig.fitter.trace.not_kept import NotKept
from rig.fitter.trace.search import Judge, prune

SAME = 1e-9
"""Relative difference below which two errors are equal."""
LeftIn = frozenset[int]
TINY = float(np.finfo(float).tiny)

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
        worst = list(p)[ties.highest(list(p.values()))]
        left.append(NotKept(*worst, "error", p[worst], error))
        chosen = tuple(j for j in chosen if j not in idle[worst])
    return chosen, tuple(left)


def left_in(
    judge: Judge,
    chosen: tuple[int, ...],
    sensors: Sequence[str],
    before: FloatArray,
    stated: Callable[[Sequence[LeftIn]], FloatArray],
) -> tuple[LeftIn, ...]:
    """Candidates, for each sensor, that have to stay in its output so that its stated error is not above that before.

    They are found, and their names are said; but what raises a sensor's error is not taken out of it. One effect after
    the other stays in, that without which the error is smallest.

    Args:
        judge: the judge at the end of the search.
        chosen: candidates found.
        sensors: the S names.
        before: (S,) error of all strata of every sensor without effects.
        stated: (S,) error of all strata of every sensor, if these candidates are left in its output.
    """
    inside: list[LeftIn] = [frozenset() for _ in sensors]
    groups = groups_of(judge, chosen)
    for i, sensor in enumerate(sensors):
        mine = [frozenset(own) for key, own in groups.items() if key[1] in (None, sensor)]
        while mine and stated(inside)[i] > before[i] * (1.0 + SAME):
            trials = [[*inside[:i], inside[i] | own, *inside[i + 1 :]] for own in mine]
            errors = [float(stated(trial)[i]) for trial in trials]
            inside[i] |= mine.pop(ties.lowest(errors, min(errors)))
    return tuple(inside)


def taken_out(chosen: tuple[int, ...], inside: Sequence[LeftIn], sensors: int) -> FloatArray:
    """(sensors, q) one where a candidate is taken out of a sensor's output, zero where it is left in it."""
    if not inside:
        return np.ones((sensors, len(chosen)))
    return np.array([[float(j not in own) for j in chosen] for own in inside]).reshape(sensors, len(chosen))


def never_above(
    judge: Judge,
    chosen: tuple[int, ...],
    stated: Callable[[tuple[int, ...]], tuple[FloatArray, FloatArray]],
    sensors: Sequence[str | None],
    level: float = ALPHA,
) -> tuple[tuple[int, ...], tuple[NotKept, ...]]:
    """The `chosen` candidates without those that raise an error that the trace states, and these with their share.

    Each effect may lower the error of its own stratum beside the others, and all of them together still raise the
    error of all strata. As long as they do, the effect goes without which the error is smallest.

    Args:
        judge: the judge at the end of the search.
        chosen: candidates to keep otherwise.
        stated: (S,) error of all strata of every sensor with some candidates, and (S,) sum of squares of residuals.
        sensors: their S names, as the candidates have them.
        level: largest p that is significant.
    """
    left: list[NotKept] = []
    while chosen:
        before, now = stated(()), stated(chosen)
        rose = now[0] > before[0] * (1.0 + SAME)
        if not np.any(rose):
            break
        risen = {None, *(name for name, one in zip(sensors, rose, strict=True) if one)}
        mine = {key: own for key, own in groups_of(judge, chosen).items() if key[1] in risen}
        mine = mine or groups_of(judge, chosen)
        rests = {key: tuple(j for j in chosen if j not in own) for key, own in mine.items()}
        fits = {key: stated(rest) for key, rest in rests.items()}
        least = np.maximum(before[0], TINY)
        errors = {key: float(np.sum(fit[0] / least)) for key, fit in fits.items()}
        worst = list(errors)[ties.lowest(list(errors.values()))]
        p = max(judge.p_adjusted(chosen, j) for j in mine[worst])
        share = 1.0 - float(np.sum(now[1])) / max(float(np.sum(fits[worst][1])), TINY)
        left.append(NotKept(*worst, "rises", p, share=min(max(share, 0.0), 1.0)))
        chosen = prune(judge, rests[worst], level)
    return chosen, tuple(left)
