"""Columns of `rig export` about the readings behind each row: scatter, number, and flags.

They are for people and for other programs. They are left out when an exported table is read: it is fitted and traced
like the run itself.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from rig.procedures.column_names import stem_of, with_word
from rig.procedures.tables.moving import Moving
from rig.procedures.tables.table import Table
from rig.procedures.tables.within import Within

if TYPE_CHECKING:
    from rig.run_file.events.points import Observed

COUNT, FLAG = "count", "flag"
"""Columns of an export that are no measured values, by their meaning."""
_READINGS, _FLAG, _SD = "readings", "flag_", "sd"
_COUNTS = frozenset({"replicate", "whole_plot", "order", "block", "run_index", _READINGS})
_FLAGS = frozenset({"accepted", "simulated"})
_OF_A_RUN = {"run_index", "block"}
"""Columns by which an exported run is recognised."""


def meaning_of(name: str) -> str:
    """`COUNT` for a number of readings or a place in the run, `FLAG` for what is or is not; "" for other columns."""
    if name in _FLAGS or name.startswith(_FLAG):
        return FLAG
    return COUNT if name in _COUNTS or name.endswith(f"_{_READINGS}") else ""


def evidence_of(seen: Observed, flags: Iterable[str]) -> dict[str, float]:
    """Scatter and number of the readings of an observation, and its flags.

    Args:
        seen: the observation.
        flags: its own, and those that were told later.

    Returns:
        By column: `x_sd_V`, the standard deviation of one reading of `x_V`; `readings`, the number of readings of the
        outputs; `force_readings`, that of a reference with another number; `flag_contradictory`, 1.
    """
    found = {with_word(name, _SD): channel["sd"] for name, channel in _channels(seen).items() if stem_of(name)}
    counts = {name: float(len(channel["readings"])) for name, channel in _channels(seen).items()}
    usual = max((counts[name] for name in seen.outputs), default=0.0)
    found |= {f"{stem_of(name)}_{_READINGS}": n for name, n in counts.items() if n != usual and stem_of(name)}
    return {**found, _READINGS: usual, **{f"{_FLAG}{flag}": 1.0 for flag in flags}}


def within_points(every: Sequence[Observed]) -> dict[str, Within]:
    """The readings of which the outputs of some observations are means, by column."""
    found = {}
    for name in dict.fromkeys(name for seen in every for name in seen.outputs):
        channels = [seen.outputs[name] for seen in every if name in seen.outputs]
        found[name] = Within.of([one["sd"] for one in channels], [len(one["readings"]) for one in channels])
    return {name: one for name, one in found.items() if one is not None}


def moving_inside(every: Sequence[tuple[Observed, Mapping[str, float]]]) -> dict[str, Moving]:
    """What had not settled when it was read, by column: outputs and what standards read.

    Args:
        every: observations, and how far each factor was changed before it.
    """
    found: dict[str, Moving] = {}
    for name in dict.fromkeys(name for seen, _ in every for name in (*seen.references, *seen.outputs)):
        there = [(channels[name], steps) for seen, steps in every if name in (channels := _channels(seen))]
        points = [np.array(channel["readings"], np.float64) for channel, _ in there]
        for factor in dict.fromkeys(factor for _, steps in there for factor in steps):
            steps_of = np.array([steps.get(factor, 0.0) for _, steps in there])
            one = Moving.seen(points, steps_of, factor)
            if one is not None and (name not in found or one.change > found[name].change):
                found[name] = one
        for way in (1.0, -1.0) if name not in found else ():
            one = Moving.seen(points, np.full(len(points), way), "")
            if one is not None:
                found[name] = replace(one, change=way * one.change)
    return found


def _channels(seen: Observed) -> Mapping[str, Mapping[str, Any]]:
    return {**seen.references, **seen.temperatures, **seen.outputs}


def fill_flags(rows: Iterable[dict[str, float]]) -> None:
    """Give every row a flag that any of them has: 0 where it has none."""
    every = list(rows)
    for name in {name for row in every for name in row if name.startswith(_FLAG)}:
        for row in every:
            row.setdefault(name, 0.0)


def without_evidence(table: Table, needed: Collection[str] = ()) -> Table:
    """An exported table as the run has it; another table as it is.

    Args:
        table: as read.
        needed: columns that somebody asks for: they stay.
    """
    names = set(table.names)
    if not names >= _OF_A_RUN or _READINGS not in names:
        return table
    sds = {with_word(name, _SD) for name in names if stem_of(name)}
    counts = {f"{stem_of(name)}_{_READINGS}" for name in names if stem_of(name)}
    left = {n for n in names if n in sds or n in counts or n == _READINGS or n.startswith(_FLAG)} - set(needed)
    kept = {name: with_word(name, _SD) for name in table.columns if stem_of(name)}
    within = {
        name: Within.of(table.columns[sd].tolist(), table.columns[_READINGS].tolist())
        for name, sd in kept.items()
        if sd in table.columns and _READINGS in table.columns and f"{stem_of(name)}_{_READINGS}" not in names
    }
    return replace(
        table,
        within={name: one for name, one in within.items() if one is not None},
        columns={name: values for name, values in table.columns.items() if name not in left},
        text={name: values for name, values in table.text.items() if name not in left},
        gaps={name: row for name, row in table.gaps.items() if name not in left},
    )
