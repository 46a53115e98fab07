"""Remaining time of a run, from the durations of its points: while it runs, and while it waits to be resumed."""

from __future__ import annotations

import itertools
from bisect import bisect_left, insort
from collections import deque
from collections.abc import Iterable, Iterator, Sequence

from rig.bench.config import BenchConfig
from rig.engine.pace import Pace
from rig.procedures.plan.conduct import Conduct
from rig.procedures.plan.hand_steps import ALLOWANCE_H
from rig.procedures.plan.run_list import RunList
from rig.run_file.chain import Record
from rig.run_file.read.reader import RunReader
from rig.run_file.state.state import RunState

LAST_POINTS = 200
"""Number of the last points from which the duration of a point is estimated."""


def typical_s(spent_s: Sequence[float]) -> float:
    """Mean duration of a point, seconds. The longest 2 % (of three or more, at least one) count as the next longest.

    One point may be hours too long because the process was stopped or the machine slept. Moves that are long by design
    occur often, and count in full.
    """
    return _typical_s(sorted(spent_s))


def _typical_s(ordered: Sequence[float]) -> float:
    longest = max(1, len(ordered) // 50) if len(ordered) > 2 else 0
    kept = ordered[: len(ordered) - longest]
    return (sum(kept) + longest * kept[-1]) / len(ordered)


class LastPoints:
    """The durations of the last points, also in order of length: sorting them at every point takes too long."""

    def __init__(self, spent_s: Iterable[float]) -> None:
        self._spent = deque(spent_s, LAST_POINTS)
        self._ordered = sorted(self._spent)

    def add(self, seconds: float) -> None:
        """Take the next one, and let go of the earliest."""
        if len(self._spent) == LAST_POINTS:
            del self._ordered[bisect_left(self._ordered, self._spent[0])]
        self._spent.append(seconds)
        insort(self._ordered, seconds)

    def typical_s(self) -> float | None:
        """Typical duration of these points, seconds; None without points."""
        return _typical_s(self._ordered) if self._ordered else None


def spent_s(observations: Iterable[Record]) -> Iterator[float]:
    """Seconds between successive observations of a session."""
    for before, now in itertools.pairwise(observations):
        if before.session == now.session and before.run_index == (now.run_index or 0) - 1:
            yield now.elapsed_s - before.elapsed_s


def by_hand_s(state: RunState) -> float:
    """Time that people are allowed for the remaining steps by hand, seconds."""
    return 3600.0 * ALLOWANCE_H * max(0, state.steps - len(state.by_hand))


def left_when_resumed_s(
    run: RunReader, state: RunState, run_list: RunList, conduct: Conduct, bench: BenchConfig
) -> float | None:
    """Remaining bench seconds of an interrupted run; None while the duration of a point is unknown.

    The model is the same as for a running run and for `rig plan`. An interrupted whole plot counts as continued.
    """
    if conduct.whole_plots is not None:
        pace = Pace(run_list, conduct, bench)
        for record in run.records():
            pace.add(record)
        pace.interrupted(state.elapsed_s)
        return pace.remaining_s(state.elapsed_s) + by_hand_s(state)
    seen = list(spent_s(run.recent(LAST_POINTS)))
    return state.remaining * typical_s(seen) + by_hand_s(state) if seen else None
