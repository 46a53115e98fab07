"""The time at which each output was read, where that is not the time of its row.

Instruments start together, but a meter whose question takes the reading is asked when the one before it has answered,
a scanner reads its channels one after another, and a person has read before.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from rig.procedures.column_names import read_at
from rig.run_file.chain import Record
from rig.run_file.events.by_hand import ReadByHand
from rig.run_file.events.points import Observed
from rig.run_file.read.reader import RunReader

_SHARE = 0.01
"""Part of the time between rows from which on a difference has a column: shorter lags than half that time are not
looked for."""

Typed = Mapping[tuple[int | None, str], Sequence[tuple[float, int]]]
"""By point and column, the elapsed time and the ordinal of each reading that a person typed."""


def typed_in(reader: RunReader) -> Typed:
    """The readings that persons typed in a run, in order."""
    found: dict[tuple[int | None, str], list[tuple[float, int]]] = {}
    for record in reader.records(ReadByHand.kind):
        event = record.event
        if isinstance(event, ReadByHand):
            found.setdefault((record.run_index, event.column), []).append((record.elapsed_s, event.number))
    return found


def own_times(record: Record, seen: Observed, typed: Typed) -> dict[str, float]:
    """Elapsed time of each output of an observation, by column; {} where the run does not say."""
    if seen.measured_s is None:
        return {}
    began, found = seen.measured_s[0], {}
    for name, (first, last) in seen.taken_s.items():
        if name in seen.outputs:
            by_hand = _before(typed.get((record.run_index, name), ()), began)
            found[read_at(name)] = round(by_hand or began + (first + last) / 2.0, 3)
    return found


def _before(typed: Sequence[tuple[float, int]], began: float) -> float | None:
    """Mean time of the readings typed last before a time, from the first of them on."""
    there = [one for one in typed if one[0] <= began]
    first = max((at for at, (_, number) in enumerate(there) if number == 1), default=0)
    return float(np.mean([elapsed_s for elapsed_s, _ in there[first:]])) if there else None


def keep_those_that_differ(rows: Sequence[dict[str, float]]) -> None:
    """Leave the columns only of outputs that were read at another time than that of the row; give them to every row."""
    times = [row["elapsed_s"] for row in rows]
    least = _SHARE * float(np.median(np.diff(times))) if len(rows) > 1 else 0.0
    names = (name for row in rows for name in row if name != "elapsed_s" and name.endswith("_elapsed_s"))
    for name in list(dict.fromkeys(names)):
        differs = any(abs(row.get(name, row["elapsed_s"]) - row["elapsed_s"]) > least for row in rows)
        for row in rows:
            own = row.pop(name, row["elapsed_s"])
            if differs:
                row[name] = own
