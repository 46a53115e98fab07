"""Searches from other starts: the first candidate may have replaced several effects that were not yet in the model.

A search that adds one candidate at a time can end with many effects in place of two or three better ones. It is
repeated only in such a case. The results are compared like alias classes, by likelihood and price of the columns.
"""

from __future__ import annotations

from rig.fitter import ties
from rig.fitter.trace.aliases import PER_COLUMN
from rig.fitter.trace.search import names_of, prune, search_and_name
from rig.procedures.attitude.trace.judge import AttitudeJudge

CROWD = 3
"""Minimum number of effects for a repeated search."""
MOST_STARTS = 5
"""Maximum number of other starts, the most evident."""


def search_with_restarts(judge: AttitudeJudge) -> tuple[AttitudeJudge, tuple[int, ...]]:
    """The judge with refined constants, and the best result of searches from several starts."""
    ends = [search_and_name(judge)]
    if _crowd(*ends[0]):
        for start in judge.starts()[:MOST_STARTS]:
            ends.append(search_and_name(judge, prune(judge, start)))
            if not _crowd(*ends[-1]) and ties.below(_price(*ends[-1]), _price(*ends[0])):
                break  # fewer causes that explain more: other starts take longest where they end in a crowd again
        return ends[ties.lowest([_price(*end) for end in ends])]
    return ends[0]


def _crowd(judge: AttitudeJudge, chosen: tuple[int, ...]) -> bool:
    return len(names_of(judge.candidates, chosen)) >= CROWD


def _price(judge: AttitudeJudge, chosen: tuple[int, ...]) -> float:
    searched = judge.searched & set(names_of(judge.candidates, chosen))
    return judge.price(chosen) + PER_COLUMN * (len(chosen) + len(searched))
