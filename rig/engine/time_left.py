"""How long the rest of a run will take, from what its points took: while it runs, and while it waits to be resumed."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence

from procedures.conduct import Conduct
from procedures.run_list import RunList
from rig.config import BenchConfig
from rig.engine.pace import Pace
from rig.run_file.chain import Record
from rig.run_file.reader import RunReader
from rig.run_file.state import RunState

LAST_POINTS = 200
"""How many of the last points tell how long one takes."""


def typical_s(spent_s: Sequence[float]) -> float:
    """What a point takes on average, seconds; the longest 2 % (of three or more, one) count as the next longest.

    A process that was stopped for hours, or a machine that slept, makes one point as long; ways that are long by
    design come again and again, and count in full.
    """
    ordered = sorted(spent_s)
    longest = max(1, len(ordered) // 50) if len(ordered) > 2 else 0
    kept = ordered[: len(ordered) - longest]
    return (sum(kept) + longest * kept[-1]) / len(ordered)


def spent_s(observations: Iterable[Record]) -> Iterator[float]:
    """Seconds from each to the next of observations that follow one another in a session."""
    for before, now in itertools.pairwise(observations):
        if before.session == now.session and before.run_index == (now.run_index or 0) - 1:
            yield now.elapsed_s - before.elapsed_s


def left_when_resumed_s(
    run: RunReader, state: RunState, run_list: RunList, conduct: Conduct, bench: BenchConfig
) -> float | None:
    """Bench seconds that the rest of an interrupted run will take; None while nothing tells how long a point takes.

    The model is that of a running one and of `rig plan`. A whole plot that was interrupted counts as going on.
    """
    if conduct.whole_plots is not None:
        pace = Pace(run_list, conduct, bench)
        for record in run.records():
            pace.add(record)
        pace.interrupted(state.elapsed_s)
        return pace.remaining_s(state.elapsed_s)
    seen = list(spent_s(run.recent(LAST_POINTS)))
    return state.remaining * typical_s(seen) if seen else None
