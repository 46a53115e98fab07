"""At what the results of a run hold, where no model has it: factors that were varied, and recorded temperatures."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from rig.procedures.column_names import stem_of, unit_of
from rig.register.surroundings import shown_unit

if TYPE_CHECKING:
    from rig.procedures.evaluate.budgeting import Evaluation
    from rig.procedures.tables.table import Table

HOLD = "results hold at the conditions of the run, which are in no model: {conditions}"
HOLD_OF = "results of {sensors} hold at the conditions of the run, which their models do not have: {conditions}"
NOT_USED = "of the points {name} is not used: the model of the results does not have it"

SLACK = 0.01
"""How far a point may be outside the recorded settings, as a share of their range: readbacks are not set points."""


def held(
    table: Table, temperatures: Collection[str], evaluation: Evaluation, at: Sequence[Mapping[str, float]]
) -> Iterator[str]:
    """Sentences about factors and recorded temperatures on which no result depends, or not that of every sensor.

    Args:
        table: the observations of the run.
        temperatures: columns with temperatures that were recorded.
        evaluation: of the results.
        at: points of the results.
    """
    columns = table.columns
    known = dict.fromkeys((*table.factors, *temperatures))
    free = [one for one in known if one not in evaluation.columns]
    told: dict[tuple[str, ...], list[str]] = {}
    for name in known:
        if name not in free and not evaluation.lack(name):
            continue
        sensors = tuple(table.outputs.get(one, one) for one in evaluation.lack(name))
        values = columns.get(name, np.zeros(0))
        values = values[np.isfinite(values)]
        if len(values):
            low, mean, high = (f"{value:.4g}" for value in (values.min(), values.mean(), values.max()))
            words, unit = stem_of(name).replace("_", " "), shown_unit(name)
            told.setdefault(sensors, []).append(f"{words} {low} to {high} {unit}, mean {mean} {unit}")
    for sensors, every in told.items():
        words = "; ".join(every)
        yield HOLD_OF.format(sensors=", ".join(sensors), conditions=words) if sensors else HOLD.format(conditions=words)
    yield from (NOT_USED.format(name=name) for name in free if any(name in one for one in at))


def outside_of(table: Table, at: Sequence[Mapping[str, float]]) -> Iterator[str]:
    """Points of results that are outside the settings of a run, one sentence each.

    An angle may be a whole turn away, and anything if the settings divide a turn into equal steps.
    """
    for name in dict.fromkeys(key for one in at for key in one if key in table.columns):
        values = np.unique(table.columns[name])
        low, high = float(values[0]), float(values[-1])
        turn = 360.0 if unit_of(name) == "deg" else 0.0
        step = float(np.max(np.diff(values), initial=0.0))
        if turn and high - low + step >= turn * (1.0 - SLACK):
            continue
        slack = SLACK * (high - low)
        for value in dict.fromkeys(one[name] for one in at if name in one):
            if not any(low - slack <= value + n * turn <= high + slack for n in (-1, 0, 1)):
                yield (
                    f"{name} = {value:g} is outside the run, which has {low:.6g} to {high:.6g}: nothing shows that the "
                    f"model holds there"
                )
