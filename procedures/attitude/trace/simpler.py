"""One cause instead of two: names found one after the other may be parts of a third.

A search adds the best effect at each step. If this is only a part of the true cause, the rest is added under another
name. Two names are replaced by one effect if all of its terms together explain as much.
"""

from __future__ import annotations

from itertools import permutations

from rig.fitter.trace.aliases import DELTA, best_first
from rig.fitter.trace.search import names_of
from rig.procedures.attitude.trace.judge import AttitudeJudge

ROUNDS = 4


def simplified(judge: AttitudeJudge, chosen: tuple[int, ...]) -> tuple[int, ...]:
    """The `chosen` candidates with one effect instead of two, wherever it explains as much within `DELTA`."""
    for _ in range(ROUNDS):
        simpler = _one_for_two(judge, chosen)
        if simpler is None:
            break
        chosen = simpler
    return chosen


def _one_for_two(judge: AttitudeJudge, chosen: tuple[int, ...]) -> tuple[int, ...] | None:
    every = judge.candidates
    for first, second in permutations(names_of(every, chosen), 2):
        both = tuple(j for name in (first, second) for j in chosen if every[j].effect.name == name)
        if len({judge.problem.judged_at[j] for j in both}) > 1:
            continue
        rest = tuple(j for j in chosen if j not in both)
        able = [r for r in judge.explanations(both, rest, DELTA) if r.alias and r.effect != first]
        if able:
            return (*rest, *best_first(able)[0].terms)
    return None
